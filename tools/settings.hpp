// Settings: everything a user asked for, in the engine's and the tiles' own types; every default stands here or in
// lib/scene.hpp. Leaves how it is spelled to options.hpp.
#pragma once
#include <cstdint>
#include <cstdlib>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "lib/coverage.hpp"
#include "lib/engine.hpp"
#include "lib/scene.hpp"
#include "tiles/polar_raster.hpp"
#include "tiles/source_choice.hpp"

namespace wedgescope {

/// The program's version.
const char* version();

/// What a file holds, read when it is first asked for and then known to all copies: a pipe gives it once.
struct TextOfFile {
    std::mutex mutex;
    std::optional<std::string> text;
};

struct Settings {
    Scene scene;
    bool altitude_given = false;
    std::string radar_set;                  ///< name of a shipped set or path; empty: none. Its values stand in `scene`
    std::string antenna_file;               ///< path that the antenna's points were read from; empty: none
    std::string track;                      ///< path; empty: one scene
    std::optional<std::int64_t> scan_step;  ///< azimuth bins; none: a frame is seen from one place
    std::optional<double> scan_period_s;    ///< of one turn of the antenna

    std::string dem, culture, culture_height;  ///< paths; empty: none
    double culture_height_scale = 1;
    std::string culture_legend;  ///< built-in word, rat or CSV path; empty: none
    std::shared_ptr<TextOfFile> legend_text;  ///< no key: of that CSV file
    std::string class_table;     ///< path of the file that scene.materials come from; empty: none
    std::string material = "soil";

    std::int64_t tile_posts = 256;  ///< --tile-size
    // Tile: what is burnt over the culture.
    std::string features, features_layer;  ///< path; a layer's name; empty: none, all
    std::string features_legend = "smc";   ///< built-in word or CSV path
    bool features_touch = false;
    std::string directivity;  ///< raster over the culture's; empty: none
    std::optional<LatLon> around;  ///< tile: the point that a spill is kept for
    // Coverage only; threads, memory and culling stand below.
    CoverageParams coverage;
    std::optional<std::int64_t> no_data_value;  ///< of the mask, declared in any case
    std::string observers;                      ///< path; empty: one sensor
    std::string observers_layer;                ///< of a vector file; empty: the only one
    std::optional<std::int64_t> at_least;       ///< observers: a mask of what so many see; none: counts
    bool snap_to_post = false;                  ///< gdal_viewshed's way: the sensor stands over the nearest post

    SourceKind source = SourceKind::automatic;
    bool keep_map = false;
    std::shared_ptr<const GroundMap> ground;  ///< no key: what find_ground() found or made
    bool needs_classes = true;                ///< no key: as DataBaseParams::classes
    bool expects_ground = false;              ///< no key: it will, as a budget has to know before
    std::string temp_dir;                     ///< empty: the system's
    int threads = 0;                          ///< 0: all the machine has
    std::int64_t wedges = 0;                  ///< 0: chosen
    std::uint64_t memory_bytes = std::uint64_t{1} << 30;

    std::string work_dir;  ///< path; empty: none
    bool resume = false;
    std::optional<Interval> only_wedges;

    std::string output, echo, power, states, report, timeline;  ///< paths; empty: not written
    std::string ground_file;                                    ///< --ground, a raster of the response; the same
    std::string power_stack;                                    ///< of a track; the same
    PowerUnit power_unit = PowerUnit::watt;
    std::string driver;                                       ///< --of
    std::vector<std::string> creation;                        ///< --co K=V
    std::vector<std::pair<std::string, std::string>> config;  ///< --config K=V
    bool no_cull = false;
    bool overwrite = false, reproducible = false;

    /// Budget: the cell that is asked for, or the place on the ground that it is to show; and how that was said.
    struct Cell {
        Angle azimuth;  ///< clockwise from the heading
        double range_m = 0;
    };
    std::optional<Cell> cell;
    std::optional<LatLon> cell_place;
    std::string cell_place_key;

    std::string table;                   ///< evaluate --in: path, - for standard input; empty: single values
    std::optional<std::int64_t> digits;  ///< evaluate: none: as many as read back the same
    bool list = false;                   ///< evaluate --list

    bool verify = false;  ///< info --verify
    bool verbose = false, profile = false, quiet = false, json = false, plan = false, help = false;
    std::vector<std::string> files;  ///< positional

    /// Asked for by --reproducible or as other programs are, by SOURCE_DATE_EPOCH in the environment.
    bool same_bytes() const {
        const char* const epoch = std::getenv("SOURCE_DATE_EPOCH");
        return reproducible || (epoch && *epoch);
    }

    std::map<std::string, std::string> given;  ///< no key: those that somebody gave, each as messages call it
    /// What messages call a key: "--target-height", or what the user wrote for it.
    std::string spelled(const std::string& key) const {
        const auto at = given.find(key);
        return at == given.end() ? "--" + key : at->second;
    }
    /// Is it given, and by an option of the command line: not by a scene file or a store?
    bool by_option(const std::string& key) const {
        const auto at = given.find(key);
        return at != given.end() && at->second.starts_with("-");
    }
};

/// The word of `culture-legend` for the raster's own attribute table.
inline constexpr const char* own_legend = "rat";

/// The culture legend that `culture-legend` names, of the raster `culture` (settings.culture, unless given) if it is its own; none
/// without one. Within a GdalSession if it is. InputError, IoError.
std::optional<Legend> legend(const Settings& settings);
std::optional<Legend> legend(const Settings& settings, const std::string& culture);
/// A built-in one or that of a CSV file; `key` is for messages.
Legend legend(const char* key, const std::string& name, const Materials& materials);

/// InputError. `shown`: the legend, as the message is to show it.
[[noreturn]] void refuse_legend_alone(const std::string& shown);
/// InputError. `given`: what needs a legend, such as "culture is given".
[[noreturn]] void refuse_missing_legend(const char* given);

/// Content of the CSV file that it names, or the raster's own legend as one; empty for a built-in one.
std::string legend_csv(const Settings& settings);
/// Path of the CSV file that it names; empty: none.
std::string legend_path(const Settings& settings);

/// What the sources need; reads the legend. `cache_bytes`: GDAL's share of the memory; `stop` is to outlive them.
DataBaseParams data_base_params(const Settings& settings, std::size_t cache_bytes, const Stop& stop);

/// Share of the memory budget for GDAL's block cache.
std::size_t cache_bytes(const Settings& settings);

/// That work at the same time: as many as are asked for, all processors where nothing is said; more than some for each processor
/// would only wait.
int thread_count(const Settings& settings);
/// Where a spilled source keeps what; `stop` and `progress` are the caller's to add.
SpillOptions spill_options(const Settings& settings);

/// Whether a picture is made: one is asked for, or nothing else is that a run would do.
bool draws(const Settings& settings);
EngineParams engine_params(const Settings& settings);

}  // namespace wedgescope
