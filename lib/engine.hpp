// Engine: the main path, scene + wedge source -> echo, power, states and scope picture.
// The only place that knows all stages. Leaves files to tiles and words to tools.
#pragma once
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "lib/beam.hpp"
#include "lib/display.hpp"
#include "lib/far_shore.hpp"
#include "lib/path_loss.hpp"
#include "lib/polar.hpp"
#include "lib/promise.hpp"
#include "lib/receiver.hpp"
#include "lib/report.hpp"
#include "lib/scene.hpp"
#include "lib/shade.hpp"
#include "lib/spoke_map.hpp"
#include "lib/stop.hpp"
#include "lib/timeline.hpp"
#include "lib/wedge_archive.hpp"
#include "lib/wedge_source.hpp"

namespace wedgescope {

/// The scene after the data base has been asked: every default a number.
struct ResolvedScene {
    Scene scene;  ///< as given, defaults filled in (geometry, range, bins, mds, delay)
    Geometry geometry = Geometry::geodesic;
    IndexPosition nadir;  ///< place on the grid, rounded to 2^-20 post
    bool has_lat_lon = false;
    double lat_deg = 0, lon_deg = 0;
    double x = 0, y = 0;     ///< raster CRS
    double sensor_m = 0;     ///< above sea level
    double reference_m = 0;  ///< bare terrain at the nadir, 0 where there is none
    double nadir_surface_m =
        0;              ///< where spokes start: with culture height, unless the sensor is inside it; only if on data
    double inside_m = 0;  ///< how far the top of what it stands inside of is over the sensor; 0: it stands free
    Chunk nadir_patch;  ///< the posts round the nadir, rows as lines; empty where it is outside the raster
    bool nadir_on_data = false;  ///< inside the raster and not void
    bool nadir_in_raster = false;
    bool nadir_beyond_posts =
        false;  ///< outside the raster or in the outer half of an outermost cell: no four posts round it
    double shorter_post_m = 0, longer_post_m = 0;  ///< from post to post along the raster's two sides, at the sensor
    Earth earth;                                   ///< of what belongs to no spoke
    double farthest_arc_m = 0;   ///< coverage only: no post that counts is farther
    bool range_limited = false;  ///< coverage only: a range was asked for
    PolarGrid shown;             ///< what was asked: power, states and scope
    PolarGrid swept;             ///< shown plus the beam's skirt and the pulse's lead-in: echo
    double noise_power_w = 0;
    double sweep_delay_m = 0;
    /// How far the sensor stands above what is highest of the ground around it, but for a hundredth of it; may be below 0. Not of
    /// coverage.
    double clearance_m = infinite;
    /// How much single posts of the ground around stand out: a quarter of the root mean square of z00 - z10 - z01 + z11 over the
    /// posting. 0 on planes and on ridges along a line; not of coverage.
    double roughness = 0;
    /// With rain: how low it is seen, by azimuths an equal part of the circle apart, from north on, of each by range ascending; of one
    /// along which no ground is known there is none. One for all azimuths where they are alike; none where no ground is known at all.
    std::vector<std::vector<RainFloor>> rain_floor;
};

/// Finds position, height above sea level and every default. InputError, DataError.
ResolvedScene resolve(const Scene& scene, WedgeSource& source);
/// The same without the data base, of another scene at a place that is known: geometry, nadir, heights and earth of `place`,
/// and its range where the scene has none. InputError.
ResolvedScene resolve(const Scene& scene, const ResolvedScene& place);

/// Bilinear heights between posts, metres above sea level; NaN over a void and outside the raster.
struct GroundHeight {
    double bare_m;
    double surface_m;  ///< with culture height
};
GroundHeight ground_height(WedgeSource& source, IndexPosition place);
/// Slant range of what range bins count: itself, or for gpi-true, whose bins count arcs, that of a level surface.
double slant_range_m(const ResolvedScene& scene, double range_m);
/// Far end of the last range bin that the scene's range reaches into: up to there all ground is swept.
double outermost_m(const ResolvedScene& scene);
/// The receiver opens for what is no nearer; slant.
double minimum_range_m(const ResolvedScene& scene);
/// Where the spokes of a resolved scene go.
SpokeMapParams swept_map_params(const ResolvedScene& scene, const DataBase& data_base);
/// How densely a scene's ground is sampled: its quality, its own keys, and what the ground and the sensor's height need.
/// The height is that over the ground right below, or 1.1 times clearance_m if that is less, but then 2 posts (with culture
/// heights 5) at least; less of it where single posts stand out. Where it so comes out below 40 posts and below that over the
/// ground right below, a post has at least 0.9, 1.2, 2 and 2.75 spokes (draft to exact). Source: docs/accuracy.md, "Beside
/// mountains" and "Needles".
Sampling sampling_of(const ResolvedScene& scene, const DataBase& data_base);
/// Shows these azimuth bins instead, 0 <= begin < circle; sweeps them and the beam's skirt.
void look_at(ResolvedScene& scene, Interval azimuth_bins);

/// Of a scene what its place does not change: made once for all frames of a track.
struct SceneTables {
    explicit SceneTables(const Scene& scene);
    ClassLaws laws;
    FarShore shore;
    Weather weather;
    PatternTable pattern;
    Receiver receiver;
};

/// What is lost on the way to anything of a scene out to a slant range; none in clear air.
std::optional<PathLossTable> loss_table(const ResolvedScene& scene, const Weather& weather, double most_range_m);

struct EngineParams {
    int threads = 0;          ///< 0: all the machine has
    std::int64_t wedges = 0;  ///< at least so many; 0: chosen
    std::size_t memory_bytes = std::size_t{1} << 30;
    bool cull = true;  ///< leave out what is known to stay hidden; never changes a bit of the result
    Stop* stop = nullptr;
    WedgeArchive* archive = nullptr;  ///< keeps finished wedges and gives back those of an earlier run
    Timeline* timeline = nullptr;
    /// Fingerprint of the data base before anything of it was read; none: as it is when the run begins.
    std::optional<std::uint64_t> data;
    std::optional<Interval> only_wedges;   ///< these alone, into the archive: no power, states or scope come out
    std::function<void(double)> progress;  ///< called with 0..1 from one thread at a time
    /// One of several runs side by side: it takes `threads` threads of those that the caller lets all of them have together.
    bool beside_others = false;
    std::shared_ptr<const SceneTables> tables;  ///< of the scene; none: made for the run
    /// The echo image and its states stay in the result. Else other images may be made in their memory.
    bool keep_echo = true;
    /// The picture is drawn. Else the scope stays empty, and so does received_w, for nobody asks for speckle and noise.
    bool draw = true;
};

struct RunResult {
    ResolvedScene scene;
    PolarImage<float> echo_w;             ///< on scene.swept; may be empty unless EngineParams::keep_echo
    PolarImage<std::uint8_t> echo_state;  ///< the same
    PolarImage<float> power_w;            ///< on scene.shown, without noise and speckle
    PolarImage<std::uint8_t> state;       ///< on scene.shown
    /// On scene.shown, what the picture was made from: of measure(), and of runs side by side that draw speckle or noise, scan, or
    /// are small; empty of others.
    PolarImage<float> received_w;
    Picture scope;
    RunReport report;
    bool levels = false;  ///< some ground was swept at a level of detail
    Sampling sampling;    ///< how densely
    Promise promise;      ///< how far the power may be off; of show(), which sweeps nothing, none

    // Written out in engine.cpp: where sources are compiled with -O1 the end of an image is a loop over all of its numbers.
    RunResult();
    RunResult(const RunResult&);
    RunResult(RunResult&&) noexcept;
    RunResult& operator=(const RunResult&);
    RunResult& operator=(RunResult&&) noexcept;
    ~RunResult();
};

BeamSetting beam_setting(const ResolvedScene& scene);
DisplaySetting display_setting(const ResolvedScene& scene);

struct Plan;
/// What run() would do, without sweeping; with what coarse bounds of the terrain say of what is hidden.
Plan plan(const ResolvedScene& scene, WedgeSource& source, const EngineParams& params);

/// The same bits for any number of wedges and threads and any budget. InputError if the budget is too small, saying
/// the smallest that would do; before any sweep. DataError if the data base changed while it was read.
RunResult run(const ResolvedScene& scene, WedgeSource& source, const EngineParams& params);
/// The same in the memory of an earlier result.
RunResult run(const ResolvedScene& scene, WedgeSource& source, const EngineParams& params, RunResult&& used);

/// The same without state and picture; echoes and received_w stay. swept.range_bins and shown.range_bins of the scene may end before its
/// range: then nothing beyond is swept, and what is nearer has the same bits.
RunResult measure(const ResolvedScene& scene, WedgeSource& source, const EngineParams& params, RunResult&& used);

/// The end of run() alone: power, states and scope of `scene` from an echo image that holds scene.swept (and may hold more): the
/// bits of a run() that makes that image. Error where it does not hold it.
RunResult show(const ResolvedScene& scene, PolarImage<float> echo_w, PolarImage<std::uint8_t> echo_state,
               const EngineParams& params);
/// True where an echo image on `stored` holds all of `wanted`, azimuths modulo the circle.
bool holds(const PolarGrid& stored, const PolarGrid& wanted);

/// A sensor that moves while its antenna turns.
struct Scan {
    std::int64_t step = 1;  ///< azimuth bins that are seen from one place; the last group may be smaller
    /// The scene from where the sensor is when it looks at these bins of the scene's: look_at() them, same bins shown in range.
    std::function<ResolvedScene(Interval azimuth_bins)> at;
};
/// As run(), but each group of azimuth bins is swept, with the beam's skirt on either side, from its own place: these are
/// the echoes that the antenna got while it looked there. The picture is drawn as the set does, which takes the sensor to
/// stand where `scene` is. Echo and states beside the shown azimuths are those of the first and the last group. A sensor
/// that does not move gives the bits of run().
RunResult run(const ResolvedScene& scene, const Scan& scan, WedgeSource& source, const EngineParams& params,
              RunResult&& used);

}  // namespace wedgescope
