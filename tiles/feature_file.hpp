// FeatureFile: the features of a vector file that lie in a window of a raster, cell by cell; and what sides they have.
// For the .cpp files of this folder only. Leaves what lies below them to burnt_layer.hpp.
//
// A feature of a higher number lies over those of lower ones, whatever the order that the file gives them in: each cell
// remembers the number of the feature that it has. So no window needs more than one feature at a time, and a cell does not
// depend on the windows asked for.
//
// Memory: one handle of the vector file for each thread that reads at the same time (`handle_bytes`, about; what a feature's
// geometry takes comes on top), and 8 + 2 bytes for each cell of the window.
#pragma once
#include <ogrsf_frmts.h>
#include <atomic>

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "lib/interval.hpp"
#include "tiles/features.hpp"
#include "tiles/gdal_handle.hpp"
#include "tiles/raster_layer.hpp"
#include "tiles/store_manifest.hpp"

namespace wedgescope {

class FeatureFile {
public:
    static constexpr std::size_t handle_bytes = std::size_t{4} << 20;
    static constexpr std::size_t cell_bytes = sizeof(std::int64_t) + 2;

    /// `terrain`: the grid whose CRS counts. IoError; InputError for a layer or fields that are not there; DataError for a CRS
    /// that PROJ knows no way from.
    FeatureFile(FeatureParams params, const RasterFacts& terrain);
    /// For sides() alone.
    explicit FeatureFile(FeatureParams params);
    ~FeatureFile();

    /// A class, and the side that a feature of it has in place of the class' own.
    struct Side {
        ClassId id = 0;
        Directivity directivity = Directivity::omni;
        int axis_deg = 0;  ///< whole degrees: below 360 of uni, below 180 of bi, 0 of omni
        friend auto operator<=>(const Side&, const Side&) = default;
        /// With its axis in whole steps.
        Side in_steps(int step_deg) const;
    };
    /// Nothing where it is the class' own.
    static std::optional<Side> own_side(const Material& material, const Side& side);
    /// Of the class that a class with a side of its own becomes.
    static std::string sided_name(const std::string& name, const Side& side);
    /// Of all features. DataError naming the feature; IoError.
    std::set<Side> sides();

    const FeatureParams& params() const { return params_; }
    bool has_materials() const { return has_materials_; }  ///< some layer has a field for them
    bool has_heights() const { return has_heights_; }
    /// Fields that are not looked at, of all layers.
    const std::vector<std::string>& left_out() const { return left_out_; }
    std::string named() const;
    StoreSource source() const;
    std::uint64_t fingerprint();

    enum class What { material, height };
    /// Calls put(place in the window, row after row; value) for every cell that a feature has, each as often as features lie over
    /// one another there, the topmost last. Values: ClassId; metres above 0. From several threads at once. DataError naming the
    /// feature; IoError.
    void burn(const RasterFacts& grid, const Window& window, What what,
              const std::function<void(std::size_t, double)>& put);
    bool burnt() const { return burnt_; }  ///< some cell has been

private:
    struct Handle;
    class Lease;
    std::unique_ptr<Handle> open();
    double value(const Handle& handle, std::size_t layer, OGRFeature& feature, What what) const;
    std::optional<ClassId> material(const Handle& handle, std::size_t layer, OGRFeature& feature) const;
    /// None: that of its class.
    std::optional<Side> side(const Handle& handle, std::size_t layer, OGRFeature& feature, ClassId id) const;
    [[noreturn]] void refuse(const Handle& handle, std::size_t layer, OGRFeature& feature, int field,
                             const std::string& found, const std::string& accepted) const;

    FeatureParams params_;
    std::shared_ptr<const Crs> crs_;  ///< of the raster; null: none
    bool geographic_ = false;
    bool attributes_only_ = false;
    bool has_materials_ = false, has_heights_ = false;
    std::vector<std::string> left_out_;
    std::mutex mutex_, opening_;  ///< a CRS is compared by one thread at a time
    std::vector<std::unique_ptr<Handle>> free_;
    std::atomic<bool> burnt_ = false;
};

}  // namespace wedgescope
