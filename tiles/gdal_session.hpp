// GdalSession: GDAL's global state, set up once: drivers, cache, errors turned into exceptions of ours, PROJ's
// network off. Leaves every file to raster.hpp and picture.hpp, and loading GDAL to late_libraries.cpp: where the program does
// that when it first calls GDAL, which some runs never do, the state is set up then.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace wedgescope {

class GdalSession {
public:
    /// `config`: GDAL configuration options (--config K=V), as long as the session lasts; sessions do not nest. Cache: the share of
    /// the budget for GDAL's block cache.
    GdalSession(std::size_t cache_bytes, const std::vector<std::pair<std::string, std::string>>& config);
    ~GdalSession();
    GdalSession(const GdalSession&) = delete;
    GdalSession& operator=(const GdalSession&) = delete;

    /// Rasters that VRTs are made of and that GDAL holds open at the most, over all threads: fewer in little memory.
    static std::size_t most_parts_open();
    static void set_cache_bytes(std::size_t bytes);
    /// What GDAL's block cache holds.
    static std::size_t cache_used_bytes();
    /// Sets up GDAL as the session that was begun last wants it; called once GDAL is there.
    static void settle();
    /// By --config, the environment or a file of its own GDAL is told how to read or write: whoever could do without it then
    /// leaves files to it.
    static bool configured();
    static std::string gdal_version();
    /// A function of GDAL's, once that is loaded, or of a library that it is linked with; null: there is none of that name.
    static void* function(const char* name);
    /// Of the session that was begun last, from 1; 0 before the first.
    static std::uint64_t number();
};

}  // namespace wedgescope
