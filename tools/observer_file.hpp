// Observer file: points with heights, of a vector file or of a CSV table (a track is one) -> the observers of a coverage.
// Its forms: docs/formats.md. Leaves geometries to tiles/point_file.hpp and cells of a table to table_file.hpp.
#pragma once
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "lib/scene.hpp"
#include "lib/stop.hpp"
#include "lib/wedge_source.hpp"

namespace wedgescope {

/// What the file says of one; all else is the scene's.
struct Observer {
    double first = 0, second = 0;  ///< latitude and longitude, degrees, or x and y of the raster
    AltitudeAbove altitude_above = AltitudeAbove::sea_level;
    std::optional<double> altitude_m;
    std::optional<double> range_m;
    std::optional<Angle> heading;
    std::int64_t number = 0;  ///< line or feature
};

class Observers {
public:
    Observers(std::string path, bool is_table, bool lat_lon, std::vector<Observer> all, std::string note)
        : path_(std::move(path)), note_(std::move(note)), is_table_(is_table), lat_lon_(lat_lon), all_(std::move(all)) {
    }

    std::size_t size() const { return all_.size(); }
    const Observer& operator[](std::size_t i) const { return all_[i]; }
    std::size_t bytes() const { return all_.capacity() * sizeof(Observer); }
    /// "observers 'x.gpkg', feature 7".
    std::string words(std::size_t i) const;
    const char* number_name() const { return is_table_ ? "line" : "feature"; }

    /// For a remark: what of the file is left out; empty: nothing.
    const std::string& note() const { return note_; }

    /// The scene of one: `base` with what the file says.
    Scene scene(const Scene& base, std::size_t i) const;

private:
    std::string path_, note_;
    bool is_table_, lat_lon_;
    std::vector<Observer> all_;
};

/// A path that ends in .csv is a table, and so is a pipe; all else is GDAL's. `layer`: of a vector file; empty: the only one. `altitude_given`:
/// the scene has an altitude for those that the file gives none. InputError, DataError, IoError naming file and line or
/// feature.
Observers read_observers(const std::string& path, const std::string& layer, bool altitude_given,
                         const DataBase& data_base, const Stop& stop);

}  // namespace wedgescope
