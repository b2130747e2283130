#include "tools/keys.hpp"

#include "lib/atmosphere.hpp"
#include "lib/seen_counts.hpp"
#include "tools/key_commands.hpp"
#include "tools/key_values.hpp"

namespace wedgescope {
namespace {

class Table {
public:
    Table& group(KeyGroup g, bool changes_result, bool after_echo = false) {
        group_ = g;
        changes_result_ = changes_result;
        after_echo_ = after_echo;
        return *this;
    }
    Key& add(const std::string& name, codecs::Codec codec, const std::string& fallback, const std::string& help) {
        Key key;
        key.name = name;
        key.value = std::move(codec.value);
        key.accepted = std::move(codec.accepted);
        key.set = std::move(codec.set);
        key.get = std::move(codec.get);
        key.fallback = fallback;
        key.help = help;
        key.group = group_;
        key.changes_result = changes_result_;
        key.after_echo = after_echo_;
        keys_.push_back(std::move(key));
        return keys_.back();
    }
    std::vector<Key> take() { return std::move(keys_); }

private:
    std::vector<Key> keys_;
    KeyGroup group_ = KeyGroup::data_base;
    bool changes_result_ = false, after_echo_ = false;
};

void add_data_base(Table& t) {
    using namespace codecs;
    using enum Dimension;
    t.group(KeyGroup::data_base, false);
    t.add("dem", path([](auto& s) -> auto& { return s.dem; }), "",
          "terrain heights: any raster GDAL opens, or a tile store; needed");
    {
        Key& culture = t.add("culture", path([](auto& s) -> auto& { return s.culture; }), "",
                             "raster of culture codes; needs culture-legend");
        culture.commands |= command_tile;
        culture.help_elsewhere = {
            {command_tile, "raster of culture codes; culture-legend may be left to the scenes over the store"}};
    }
    t.add("culture-height", path([](auto& s) -> auto& { return s.culture_height; }), "",
          "raster of the heights of what stands on the terrain")
        .commands |= command_tile;
    {
        Key& scale = t.add("culture-height-scale",
                           number(
                               at_least("0"), [](auto& s) -> auto& { return s.culture_height_scale; }),
                           "1",
                           "metres in one unit of the culture-height raster (0.1 for tenths of a metre); of a tile "
                           "store's own heights the store knows it");
        scale.commands |= command_tile;
        scale.help_elsewhere = {{command_tile,
                                 "metres in one unit of the culture-height raster (0.1 for tenths of a metre); kept in "
                                 "the store, whose scenes take it unless they are given another"}};
    }
    t.add("culture-legend", legend_choice(), "",
          "turns culture codes into materials: a built-in legend, rat for the raster's own attribute table, or a CSV "
          "file of lines code,material")
        .commands |= command_info | command_tile;
    {
        Key& table = t.add("class-table", class_table(), "",
                           "CSV file of what materials return (as docs/classes.csv): its rows replace those of the "
                           "program's table or add classes");
        table.commands |= command_info | command_tile | command_coverage;
        table.changes_result = true;
    }
    t.add("material", material_choice(), "soil", "the ground where there is no culture, or where it has no data");
}

void add_position(Table& t) {
    using namespace codecs;
    using enum Dimension;
    t.group(KeyGroup::position, true);
    t.add("latlon", latlon(), "", "sensor position, WGS84 degrees; exactly one of latlon and xy").exclusive =
        Exclusive::place;
    t.add("xy", xy(), "", "sensor position in the terrain raster's own coordinates").exclusive = Exclusive::place;
    t.add("altitude-msl", altitude(AltitudeAbove::sea_level), "",
          "sensor height above sea level; exactly one altitude is needed")
        .exclusive = Exclusive::altitude;
    t.add("altitude-agl", altitude(AltitudeAbove::ground), "", "sensor height above the bare terrain under it")
        .exclusive = Exclusive::altitude;
    t.add("altitude-hae", altitude(AltitudeAbove::ellipsoid), "",
          "sensor height above the WGS84 ellipsoid; needs geoid-offset")
        .exclusive = Exclusive::altitude;
    t.add(
        "geoid-offset",
        quantity(
            length, between("-200m", "200m"), [](auto& s) -> auto& { return s.scene.platform.geoid_offset_m; }, "none"),
        "none", "height of the geoid (sea level) above the ellipsoid at the sensor, for altitude-hae");
    t.add("heading",
          quantity(
              angle, between("-360deg", "360deg"), [](auto& s) -> auto& { return s.scene.platform.heading; }),
          "0deg", "clockwise from north");

    {
        Key& track = t.add("track", path([](auto& s) -> auto& { return s.track; }), "",
                           "CSV table of times, positions, altitudes and headings, instead of one of each: a picture a "
                           "row, numbered scope_0001.png and so on; - is standard input");
        track.exclusive = Exclusive::track;
        track.changes_result = false;
    }
    t.add("scan-step",
          count(
              1, 1000000, [](auto& s) -> auto& { return s.scan_step; }, "off"),
          "off",
          "of a track: so many azimuth bins at a time are seen from where the sensor is then; off: all of them from "
          "the row's place")
        .of_track = true;
    t.add("scan-period",
          quantity(
              time, above_to("0s", "100000s"), [](auto& s) -> auto& { return s.scan_period_s; }, "none"),
          "none", "time of a full turn of the antenna, for scan-step; a row's time is that of the first azimuth")
        .of_track = true;
}

void add_look(Table& t) {
    using namespace codecs;
    using enum Dimension;
    t.group(KeyGroup::look, true);
    t.add("sector", sector(), "full", "azimuths swept, relative to heading, clockwise");
    t.add("range",
          quantity(
              length, above_to("0m", "10000km"), [](auto& s) -> auto& { return s.scene.range_m; }, "auto"),
          "auto",
          "largest slant range (display gpi-true: ground range); auto: the nearer of the farthest edge of the terrain "
          "and the radar horizon")
        .help_elsewhere = {{command_coverage, "largest slant range; auto: no limit"}};
    t.add("range-start",
          quantity(
              length, between("0m", "9999km"), [](auto& s) -> auto& { return s.scene.range_start_m; }),
          "0m", "smallest slant range (display gpi-true: ground range)")
        .help_elsewhere = {{command_coverage, "smallest slant range"}};
    t.add("geometry",
          choice<std::optional<Geometry>>(
              {{"geodesic", Geometry::geodesic}, {"grid", Geometry::grid}},
              [](auto& s) -> auto& { return s.scene.geometry; }, "auto"),
          "auto",
          "geodesics on WGS84, or straight lines on the raster's own plane; auto: geodesic where the raster has a CRS");
    t.add("earth", earth(), "4/3", "factor of the earth's radius for straight rays, or a flat earth");
    t.add("azimuth-bins",
          count(
              1, 1000000, [](auto& s) -> auto& { return s.scene.azimuth_bins; }, "auto"),
          "auto", "azimuth bins in the full circle; auto: four a beamwidth");
    t.add(
        "range-bin",
        quantity(
            length, between("0.001m", "1000km"), [](auto& s) -> auto& { return s.scene.range_bin_m; }, "auto"),
        "auto",
        "slant range (display gpi-true: ground range) in one bin; auto: c tau/8, a quarter of the pulse on the ground");
    Key& quality = t.add("quality",
                         choice<Quality>(
                             {{"exact", Quality::exact},
                              {"fine", Quality::fine},
                              {"normal", Quality::normal},
                              {"draft", Quality::draft}},
                             [](auto& s) -> auto& { return s.scene.quality; }),
                         "normal", "how finely the ground is sampled");
    quality.exclusive = Exclusive::accuracy;
    quality.get = [own = quality.get](const Settings& s) -> std::optional<std::string> {
        return s.scene.max_error_db ? std::nullopt : own(s);
    };
    {
        Key& error = t.add(
            "max-error", max_error(), "",
            "in place of quality: the quickest one whose power image keeps to this RMS, where a beam has four azimuth "
            "bins or more: draft from 0.4dB, normal from 0.1dB, fine from 0.05dB, exact from 0.02dB");
        error.exclusive = Exclusive::accuracy;
        error.help_elsewhere = {{command_coverage,
                                 "the quality that simulate takes for this RMS of its power image: draft from 0.4dB, "
                                 "normal from 0.1dB, fine from 0.05dB, exact from 0.02dB"}};
    }
    t.add("spokes-per-post",
          number(
              between("0.25", "16"), [](auto& s) -> auto& { return s.scene.spokes_per_post; }, "auto"),
          "auto",
          "least spokes for each post of a line; auto: as the quality says, and from high up fewer where bins are wide")
        .help_elsewhere = {
        {command_coverage, "spokes for each post of a line; auto: 1 (draft), 2 (normal, fine), 4 (exact)"}};
    t.add("spokes-per-bin",
          number(
              between("2", "256"), [](auto& s) -> auto& { return s.scene.spokes_per_bin; }, "auto"),
          "auto",
          "least spokes for each azimuth bin, near and far; auto: as the quality says, and more where refine finds "
          "that it takes them");
    t.add("spoke-lead",
          number(
              between("1", "64"), [](auto& s) -> auto& { return s.scene.spoke_lead; }, "auto"),
          "auto",
          "spokes double where a line this many times as far off needs it: few then share a parent's horizon; auto: as "
          "the quality says");
    t.add("crossings",
          choice<std::optional<bool>>(
              {{"on", true}, {"off", false}}, [](auto& s) -> auto& { return s.scene.crossings; }, "auto"),
          "auto", "spokes are sampled where they cross the lines of the other axis too; auto: on")
        .help_elsewhere = {{command_coverage,
                            "spokes are sampled where they cross the lines of the other axis too; auto: as far as 64 "
                            "posts, beyond as the quality says"}};
    t.add("course",
          choice<std::optional<bool>>(
              {{"curved", true}, {"straight", false}}, [](auto& s) -> auto& { return s.scene.curved_course; }, "auto"),
          "auto", "how the surface runs between two samples in a cell; auto: curved")
        .help_elsewhere = {
        {command_coverage, "how the surface runs between two samples in a cell; auto: curved as far as 64 posts"}};
    t.add("refine",
          choice<bool>(
              {{"on", true}, {"off", false}}, [](auto& s) -> auto& { return s.scene.refine; }),
          "on",
          "azimuth bins that every other spoke alone would draw differently are swept again with twice the spokes, up "
          "to three times: glimpses of crests out of shadows; not with spokes-per-bin or spokes-per-post");
    t.add("detail",
          choice<bool>(
              {{"auto", true}, {"off", false}}, [](auto& s) -> auto& { return s.scene.detail; }),
          "auto",
          "levels of detail: auto: of fine ground every 2nd to 32nd post where normal and draft keep what they "
          "promise; off: every post");

    {
        const auto budget_only = [](Key& key) {
            key.commands = command_budget;
            key.in_scene_file = false;
            key.changes_result = false;
        };
        budget_only(t.add("at", cell(), "",
                          "the cell: azimuth clockwise from the heading, as sector's, and slant range (ground range "
                          "with display gpi-true)"));
        Key& place = t.add("at-latlon", other_place(&Settings::cell_place), "",
                           "or the place on the ground that the cell is to show, WGS84 degrees");
        place.set = [set = place.set](Settings& s, const Given& given) {
            set(s, given);
            s.cell_place_key = given.origin.starts_with("--") ? given.origin.substr(2) : given.origin;
        };
        budget_only(place);
    }
}

void add_coverage(Table& t) {
    using namespace codecs;
    using enum Dimension;
    t.group(KeyGroup::coverage, true);
    {
        const auto coverage_only = [&](Key& key) {
            key.commands = command_coverage;
            key.in_scene_file = false;
        };
        coverage_only(t.add(
            "layer",
            choice<CoverageLayer>(
                {{"mask", CoverageLayer::mask},
                 {"states", CoverageLayer::states},
                 {"height", CoverageLayer::height},
                 {"range", CoverageLayer::range},
                 {"grazing", CoverageLayer::grazing},
                 {"depression", CoverageLayer::depression},
                 {"response", CoverageLayer::response}},
                [](auto& s) -> auto& { return s.coverage.layer; }),
            "mask",
            "seen or not; 0 no data, 1 shadow, 2 seen, 3 unknown, 4 outside; metres to be raised to be seen; slant "
            "range, m; ray to ground, deg; below the horizontal, deg; what a radar gets of each post, dBm"));
        {
            Key& observers = t.add("observers", path([](auto& s) -> auto& { return s.observers; }), "",
                                   "many sensors instead of one: the points of a vector file, or of a CSV table (a "
                                   "track and a pipe are one; - is standard input), with fields height (above ground) "
                                   "or altitude (above the sea), range, heading where the options do not say it for "
                                   "all; OUT holds how many of them see each post, 65535 where there is no data");
            coverage_only(observers);
            observers.exclusive = Exclusive::place;
            observers.changes_result = false;
            Key& layer = t.add("observers-layer", word_of("NAME", &Settings::observers_layer), "",
                               "of a vector file that has several");
            coverage_only(layer);
            layer.changes_result = false;
        }
        coverage_only(
            t.add("at-least",
                  count(
                      1, static_cast<std::int64_t>(most_observers), [](auto& s) -> auto& { return s.at_least; }, "off"),
                  "off", "with observers: a mask of what at least so many of them see, instead of counts"));
        coverage_only(t.add("target-height",
                            quantity(
                                length, between("0m", "100km"), [](auto& s) -> auto& { return s.coverage.target_m; }),
                            "0m", "of what stands on the post that is looked at"));
        coverage_only(t.add(
            "ground-range",
            quantity(
                length, above_to("0m", "10000km"), [](auto& s) -> auto& { return s.scene.ground_range_m; }, "none"),
            "none", "largest distance along the ground, however high sensor and post stand"));
        coverage_only(t.add("pitch", pitch(), "full", "elevation angles at the sensor that count"));
        coverage_only(t.add("seen-value", mask_value([](auto& s) -> auto& { return s.coverage.mask.seen; }), "255",
                            "of the mask where the ground is seen"));
        coverage_only(t.add("hidden-value", mask_value([](auto& s) -> auto& { return s.coverage.mask.hidden; }), "0",
                            "of the mask where it is not"));
        coverage_only(t.add("outside-value", mask_value([](auto& s) -> auto& { return s.coverage.mask.outside; }), "1",
                            "of the mask out of range, sector or pitch"));
        coverage_only(t.add("no-data-value",
                            count(
                                0, 255, [](auto& s) -> auto& { return s.no_data_value; }, "auto"),
                            "auto",
                            "of the mask where the terrain is void, declared; auto: 1 (2 where seen or hidden is 1), "
                            "declared if any post is void or out of range"));
    }
}

void add_radar(Table& t) {
    using namespace codecs;
    using enum Dimension;
    t.group(KeyGroup::radar, false);
    t.add("set", set_choice(), "",
          "a radar set: values for the keys of radar, antenna, receiver and errors that are given nowhere else (help "
          "sets shows the shipped ones)")
        .commands |= command_scope;
    t.group(KeyGroup::radar, true);
    t.add("frequency",
          quantity(
              frequency, between("1MHz", "1000GHz"), [](auto& s) -> auto& { return s.scene.radar.frequency_hz; }),
          "16.5GHz", "carrier frequency");
    t.add("transmit-power",
          quantity(
              power, between("0.001W", "1000MW"), [](auto& s) -> auto& { return s.scene.radar.transmit_power_w; }),
          "50kW", "peak power");
    t.add("gain",
          quantity(
              decibel, between("-100dB", "100dB"), [](auto& s) -> auto& { return s.scene.radar.gain; }),
          "34dB", "peak antenna gain, one-way");
    t.add("losses",
          quantity(
              decibel, between("0dB", "100dB"), [](auto& s) -> auto& { return s.scene.radar.losses; }),
          "6dB", "all system losses together");
    t.add("pulse",
          quantity(
              time, between("0.0001us", "1000us"), [](auto& s) -> auto& { return s.scene.radar.pulse_s; }),
          "0.5us", "(compressed) pulse length");
    t.add("noise-figure",
          quantity(
              decibel, between("0dB", "100dB"), [](auto& s) -> auto& { return s.scene.radar.noise_figure; }),
          "8dB", "of the receiver");
    t.add("bandwidth",
          quantity(
              frequency, above("0Hz"), [](auto& s) -> auto& { return s.scene.radar.bandwidth_hz; }, "auto"),
          "auto", "noise bandwidth; auto: 1.2 / pulse");
    t.add("polarisation",
          choice<Polarisation>(
              {{"hh", Polarisation::hh}, {"vv", Polarisation::vv}, {"circular", Polarisation::circular}},
              [](auto& s) -> auto& { return s.scene.radar.polarisation; }),
          "hh", "sent and received; circular: of one sense both ways, which rain hardly answers to");
}

void add_antenna(Table& t) {
    using namespace codecs;
    using enum Dimension;
    t.group(KeyGroup::antenna, true);
    t.add("beam",
          quantity(
              angle, between("0.002deg", "90deg"), [](auto& s) -> auto& { return s.scene.radar.antenna.beam; }),
          "1.5deg", "azimuth beamwidth, one-way, between half-power points");
    t.add("azimuth-pattern",
          choice<AzimuthPattern>(
              {{"gaussian", AzimuthPattern::gaussian}, {"uniform", AzimuthPattern::uniform}},
              [](auto& s) -> auto& { return s.scene.radar.antenna.azimuth; }),
          "gaussian", "shape of the beam in azimuth");
    t.add("antenna", antenna_choice(), "csc2",
          "shape of the pattern in elevation: a law, or a CSV file of lines depression_deg,gain_db (then knee, width "
          "and exponent play no part)");
    t.add("antenna-knee",
          quantity(
              angle, between("-90deg", "90deg"), [](auto& s) -> auto& { return s.scene.radar.antenna.knee; }),
          "5deg", "depression of the nose in the antenna's frame; above 0deg for the shaped patterns");
    t.add("antenna-width",
          quantity(
              angle, above_to("0deg", "180deg"), [](auto& s) -> auto& { return s.scene.radar.antenna.width; }),
          "12deg", "elevation beamwidth (above the knee for the shaped patterns)");
    t.add("antenna-exponent",
          number(
              between("0", "10"), [](auto& s) -> auto& { return s.scene.radar.antenna.exponent; }),
          "0.5", "power of the cosine, cos-csc2 only");
    t.add("antenna-floor",
          quantity(
              decibel, between("-200dB", "0dB"), [](auto& s) -> auto& { return s.scene.radar.antenna.floor; }),
          "-60dB", "least value of the elevation pattern");
    t.add("tilt",
          quantity(
              angle, between("-90deg", "90deg"), [](auto& s) -> auto& { return s.scene.radar.antenna.tilt; }),
          "0deg", "of the antenna, positive down; the nose is at knee + tilt");
}

void add_ground(Table& t) {
    using namespace codecs;
    using enum Dimension;
    t.group(KeyGroup::ground, true);
    t.add("backscatter",
          choice<LandModel>(
              {{"constant-gamma", LandModel::constant_gamma},
               {"ulaby-dobson", LandModel::ulaby_dobson},
               {"oh", LandModel::oh}},
              [](auto& s) -> auto& { return s.scene.land; }),
          "constant-gamma",
          "model of land; a class that it does not know keeps its constant gamma (oh: all but sand and soil); "
          "ulaby-dobson and oh from 1 to 18 GHz, the former below 8 GHz by its rows for C band");
    t.add("water",
          choice<WaterModel>(
              {{"nrl", WaterModel::nrl}, {"calm", WaterModel::calm}}, [](auto& s) -> auto& { return s.scene.water; }),
          "nrl", "model of water: waves of sea-state, or the mirror of calm inland water round the vertical");
    t.add("sea-state",
          number(
              between("0", "6"), [](auto& s) -> auto& { return s.scene.sea_state; }),
          "0", "Douglas, for nrl; 0: water returns nothing");
    t.add("wind-direction",
          quantity(
              angle, between("-360deg", "360deg"), [](auto& s) -> auto& { return s.scene.wind_from; }, "none"),
          "none",
          "azimuth that the wind blows from, clockwise from north, for nrl: the sea returns most upwind; none: the "
          "mean over all directions");
    t.add("far-shore", on_off([](auto& s) -> auto& { return s.scene.far_shore; }), "off",
          "banks and walls that rise behind water are lit by way of its mirror too, as far as sea-state leaves one");
    t.add("walls",
          choice<Walls>(
              {{"resolved", Walls::resolved}, {"statistical", Walls::statistical}},
              [](auto& s) -> auto& { return s.scene.walls; }),
          "resolved",
          "those that culture heights make; or, of classes whose table gives structures finer than a post, their mean, "
          "which also raises the ground by the share that they cover");
    t.add("gamma",
          quantity(
              decibel, between("-100dB", "100dB"), [](auto& s) -> auto& { return s.scene.gamma; }, "off"),
          "off", "one constant gamma at 10 GHz for everything, walls and water included (studies); off: by material");
}

void add_weather(Table& t) {
    using namespace codecs;
    using enum Dimension;
    t.group(KeyGroup::weather, true);
    t.add("gases",
          named(
              density, between("0g/m3", "100g/m3"), {{"normal", normal_vapour_g_m3}, {"high", high_vapour_g_m3}},
              [](auto& s) -> auto& { return s.scene.weather.vapour_g_m3; }, "none"),
          "none", "attenuation by oxygen and by so much water vapour at sea level (normal 7.5g/m3, high 20g/m3)");
    {
        std::vector<std::pair<std::string, double>> rates;
        for (const RainCategory& category : rain_categories) rates.emplace_back(category.name, category.rate_mm_h);
        t.add("rain",
              named(
                  rain_rate, between("0mm/h", "500mm/h"), rates,
                  [](auto& s) -> auto& { return s.scene.weather.rain_mm_h; }),
              "clear",
              "attenuates and returns an echo below rain-top (drizzle 0.25mm/h, light 1, moderate 4, heavy 16, "
              "excessive 40); its echo is Rayleigh's, too strong from 40 GHz on (from 30 in more than 20mm/h)");
    }
    t.add("rain-top",
          quantity(
              length, between("-1km", "20km"), [](auto& s) -> auto& { return s.scene.weather.rain_top_m; }),
          "3km", "above sea level");
    t.add("cloud",
          named(
              density, between("0g/m3", "10g/m3"), {{"none", 0.0}, {"fog", 0.05}, {"thick-fog", 0.5}},
              [](auto& s) -> auto& { return s.scene.weather.liquid_water_g_m3; }),
          "none",
          "liquid water from cloud-base to cloud-top; it attenuates (fog 0.05g/m3: visibility 300 m; thick-fog "
          "0.5g/m3: 50 m)");
    t.add("cloud-base",
          quantity(
              length, between("-1km", "20km"), [](auto& s) -> auto& { return s.scene.weather.cloud_base_m; }),
          "0m", "above sea level");
    t.add("cloud-top",
          quantity(
              length, between("-1km", "20km"), [](auto& s) -> auto& { return s.scene.weather.cloud_top_m; }),
          "1km", "above sea level; above cloud-base");
}

void add_receiver(Table& t) {
    using namespace codecs;
    using enum Dimension;
    t.group(KeyGroup::receiver, true, true);
    t.add("if-gain",
          quantity(
              decibel, between("-200dB", "300dB"), [](auto& s) -> auto& { return s.scene.receiver.if_gain; }),
          "50dB", "a signal shows when it exceeds mds by 64 dB less this");
    t.add("video-gain",
          quantity(
              decibel, between("-100dB", "100dB"), [](auto& s) -> auto& { return s.scene.receiver.video_gain; }),
          "4dB", "stretches what shows; 4dB leaves it");
    t.add("stc-range",
          quantity(
              length, above("0m"), [](auto& s) -> auto& { return s.scene.receiver.stc_range_m; }, "off"),
          "off", "sensitivity time control: attenuates echoes nearer than this");
    t.add("stc-exponent",
          number(
              between("0", "10"), [](auto& s) -> auto& { return s.scene.receiver.stc_exponent; }),
          "4", "power of range that STC evens out");
    t.add("stc-max",
          quantity(
              decibel, between("0dB", "200dB"), [](auto& s) -> auto& { return s.scene.receiver.stc_max; }),
          "40dB", "most that STC attenuates");
    t.add("dynamic-range",
          quantity(
              decibel, above_to("0dB", "200dB"), [](auto& s) -> auto& { return s.scene.receiver.dynamic_range; }),
          "20dB", "of the logarithmic amplifier, black to white, where the limiter clips");
    t.add("mds",
          quantity(
              level, between("-300dBm", "200dBm"), [](auto& s) -> auto& { return s.scene.receiver.mds_dbm; }, "auto"),
          "auto", "minimum discernible signal; auto: the thermal noise k T0 B F");
    t.add("minimum-range",
          quantity(
              length, between("0m", "10000km"), [](auto& s) -> auto& { return s.scene.receiver.minimum_range_m; },
              "auto"),
          "0m", "nothing is received from nearer, slant range; auto: c tau/2, until the pulse has left");
    t.add("display-gamma",
          number(
              between("0.1", "10"), [](auto& s) -> auto& { return s.scene.receiver.display_gamma; }),
          "1", "exponent 1/gamma of the grey scale");
}

void add_errors(Table& t) {
    using namespace codecs;
    using enum Dimension;
    t.group(KeyGroup::errors, true);
    t.add("bwe", on_off([](auto& s) -> auto& { return s.scene.radar.beam_width_error; }), "on",
          "beam-width error: echoes as wide as the beam");
    t.add("ple", on_off([](auto& s) -> auto& { return s.scene.radar.pulse_length_error; }), "on",
          "pulse-length error: echoes as long as the pulse");
    t.add("bwe-scale",
          number(
              between("0.1", "20"), [](auto& s) -> auto& { return s.scene.radar.beam_width_scale; }),
          "1", "bwe: echoes this many times as wide, with the same total power");
    t.add("ple-scale",
          number(
              between("0.1", "20"), [](auto& s) -> auto& { return s.scene.radar.pulse_length_scale; }),
          "1", "ple: echoes this many times as long, with the same total power");
    t.group(KeyGroup::errors, true, true);
    t.add("noise", on_off([](auto& s) -> auto& { return s.scene.receiver.noise; }), "off",
          "fluctuation of the thermal noise round its mean");
    t.add("speckle",
          count(
              0, 10000, [](auto& s) -> auto& { return s.scene.receiver.speckle_looks; }),
          "0",
          "fluctuation of the ground's echo, averaged over so many looks, of which each costs a pass over the "
          "picture's cells; 0: none");
    t.add("seed", seed(), "1", "of noise and speckle; each frame of a track takes one more than the one before");
}

void add_display(Table& t) {
    using namespace codecs;
    using enum Dimension;
    t.group(KeyGroup::display, true);
    t.add("display",
          choice<DisplayKind>(
              {{"gpi", DisplayKind::gpi},
               {"gpi-true", DisplayKind::gpi_true},
               {"ppi", DisplayKind::ppi},
               {"tdppi", DisplayKind::tdppi}},
              [](auto& s) -> auto& { return s.scene.display.kind; }),
          "gpi",
          "radius on the tube: ground range by the set's sweep, each echo's own ground range, slant range, slant range "
          "less a delay");
    t.group(KeyGroup::display, true, true);
    t.add("sweep-delay", sweep_delay(), "altitude",
          "tdppi: slant range of the tube's centre, or the time of the way there and back; altitude: height above the "
          "ground below");
    t.add("size",
          count(
              16, 32768, [](auto& s) -> auto& { return s.scene.display.size; }),
          "1024", "pixels of the picture's longer side");
    t.add("orientation",
          choice<Orientation>(
              {{"north", Orientation::north}, {"heading", Orientation::heading}},
              [](auto& s) -> auto& { return s.scene.display.orientation; }),
          "north", "what is up");
    t.add("centre", tube_centre(), "auto",
          "where the sensor stands on a square tube, in halves of its side from the middle to the right and up "
          "(0,-0.9: near the bottom); auto: the frame fits the sector");
    t.add("rings", on_off([](auto& s) -> auto& { return s.scene.display.rings; }), "on",
          "range rings, and ticks each 10 degrees at the rim");
    t.add(
        "ring-spacing",
        quantity(
            length, above_to("0m", "10000km"), [](auto& s) -> auto& { return s.scene.display.ring_spacing_m; }, "auto"),
        "auto", "from ring to ring, on the display's own radius; auto: a round number of nautical miles");
    t.add("azimuth-marks",
          quantity(
              angle, between("1deg", "180deg"), [](auto& s) -> auto& { return s.scene.display.azimuth_marks_rad; },
              "off"),
          "off", "radial lines, from the heading on to either side every so many degrees");
    t.add("pixel-fill",
          choice<PixelFill>(
              {{"interpolate", PixelFill::interpolate}, {"holes", PixelFill::holes}, {"none", PixelFill::none}},
              [](auto& s) -> auto& { return s.scene.display.pixel_fill; }),
          "interpolate",
          "pixels between cells: interpolated; each cell on one pixel, and holes filled from the pixels round them; "
          "holes left black");
    t.add("alpha", on_off([](auto& s) -> auto& { return s.scene.display.alpha; }), "off",
          "an alpha channel, transparent where the data base has no data");
    t.add("legend", on_off([](auto& s) -> auto& { return s.scene.display.legend; }), "off",
          "a panel with text beside the picture (needs the program wedgescope_picture)")
        .help_elsewhere = {{command_scope,
                            "a panel with text beside the picture (needs the program wedgescope_picture, and a scene "
                            "file that names the data base)"}};
}

void add_run(Table& t) {
    using namespace codecs;
    using enum Dimension;
    constexpr std::int64_t many = std::int64_t{1} << 20;
    t.group(KeyGroup::run, false);
    t.add("wedges",
          count(
              1, many, [](auto& s) -> auto& { return s.wedges; }, "auto"),
          "auto", "at least so many; changes no bit of the result");
    t.add("threads",
          count(
              1, 4096, [](auto& s) -> auto& { return s.threads; }, "all"),
          "all", "at most 32, or four for each processor, are used; changes no bit of the result")
        .commands |= command_tile;
    t.add("memory",
          quantity(
              bytes, above("0B"), [](auto& s) -> auto& { return s.memory_bytes; }),
          "1GiB", "most to be held, beside 64 MiB for the program; changes no bit of the result")
        .commands |= command_info | command_tile;
    {
        Key& size = t.add("tile-size",
                          count(
                              64, 2048, [](auto& s) -> auto& { return s.tile_posts; }),
                          "256", "posts of a tile's side: 64, 128, 256, 512, 1024 or 2048");
        size.commands = command_tile;
        size.in_scene_file = false;
    }
    {
        Key& k = t.add("around", other_place(&Settings::around), "",
                       "also keep the terrain sorted into wedges round this point, for scenes from there; FOLDER "
                       "alone: of a store that stands");
        k.commands = command_tile;
        k.in_scene_file = false;
    }
    {
        const auto tile_only = [](Key& key) {
            key.commands = command_tile;
            key.in_scene_file = false;
        };
        tile_only(t.add("features", path([](auto& s) -> auto& { return s.features; }), "",
                        "vector file of points, lines and areas that are burnt over culture and culture-height, or "
                        "make them: fields material (a word, or a code of features-legend) or SMC, height or HGT, "
                        "metres, and directivity (omni, uni, bi) with axis, degrees from north"));
        tile_only(t.add(
            "directivity", path([](auto& s) -> auto& { return s.directivity; }), "",
            "raster on culture's grid of the side that reflects, in place of the class' own: 0 to 359 the azimuth of "
            "one (uni), 360 to 539 that of two and 360 more (bi), 540 none (omni), degrees from north"));
        tile_only(t.add("features-layer", word_of("NAME", &Settings::features_layer), "",
                        "this layer of the vector file alone; without it all, later ones over those before"));
        tile_only(t.add("features-legend", features_legend(), "smc",
                        "turns numbers in the features' field of material into materials"));
        tile_only(t.add("features-touch", on_off([](auto& s) -> auto& { return s.features_touch; }), "off",
                        "burn every cell that a line or an area touches; off: lines one cell wide, and cells whose "
                        "centre lies in an area"));
    }
    t.add("work-dir", path([](auto& s) -> auto& { return s.work_dir; }), "",
          "folder where finished wedges are kept, for resume; made if it is missing");
    {
        Key& resume = t.add("resume", flag([](auto& s) -> auto& { return s.resume; }), "off",
                            "go on with the run in work-dir, or begin it; wedges that are done are used again");
        resume.commands |= command_tile;
        resume.help_elsewhere = {{command_tile, "go on with FOLDER.part, what a run that was stopped has left"}};
    }
    t.add("only-wedge", only_wedge(), "",
          "these wedges alone, counted from 0, into work-dir; several processes may fill one folder, and resume then "
          "makes the picture");

    t.add("source",
          choice<SourceKind>(
              {{"auto", SourceKind::automatic}, {"direct", SourceKind::direct}, {"spilled", SourceKind::spilled}},
              [](auto& s) -> auto& { return s.source; }),
          "auto",
          "rasters by windows, or sorted into wedges in one pass; auto: direct unless windows read them badly; changes "
          "no bit of the result");
    t.add("temp-dir", path([](auto& s) -> auto& { return s.temp_dir; }), "",
          "folder for what does not fit into memory; without it CPL_TMPDIR, TMPDIR or /tmp");
    t.add("keep-map", flag([](auto& s) -> auto& { return s.keep_map; }), "off",
          "keep what is found of a plain raster's ground (bounds and detail by block) beside it, as RASTER.ground: "
          "later runs read less; changes no bit of the result");
    t.add("no-cull", flag([](auto& s) -> auto& { return s.no_cull; }), "off",
          "read and sweep also what is known to stay hidden; changes no bit of the result");
}

void add_output(Table& t) {
    using namespace codecs;
    using enum Dimension;
    t.group(KeyGroup::output, false);
    {
        Key& o = t.add("output", path([](auto& s) -> auto& { return s.output; }), "", "the scope picture");
        o.help_elsewhere = {{command_evaluate, "the table, without this on standard output"}};
        o.letter = 'o';
        o.commands |= command_evaluate;
    }
    {
        Key& in = t.add("in", path([](auto& s) -> auto& { return s.table; }), "",
                        "CSV table of inputs, a line of column names and a row a line; - is standard input");
        in.commands = command_evaluate;
        in.in_scene_file = false;
    }
    {
        Key& d = t.add("digits",
                       count(
                           1, 17, [](auto& s) -> auto& { return s.digits; }, "all"),
                       "all", "significant digits of the results; all: as many as read back the same number");
        d.commands = command_evaluate;
        d.in_scene_file = false;
    }
    t.add("echo", path([](auto& s) -> auto& { return s.echo; }), "",
          "echo image, watts, and states, before beam and pulse");
    t.add("power", path([](auto& s) -> auto& { return s.power; }), "", "power image, after beam and pulse");
    t.add("power-stack", path([](auto& s) -> auto& { return s.power_stack; }), "",
          "of a track: the power images of all frames in one GeoTIFF, a band each, beside or instead of numbered "
          "files; all must have as many bins")
        .of_track = true;
    t.add("states", path([](auto& s) -> auto& { return s.states; }), "",
          "0 no data, 1 shadow, 2 seen, 3 unknown, 4 outside");
    t.add(
        "ground", path([](auto& s) -> auto& { return s.ground_file; }), "",
        "what the set gets of each post, dBm, on the raster's own posts: coverage's layer response of the same scene");
    t.add("report", path([](auto& s) -> auto& { return s.report; }), "",
          "JSON: inputs, parameters, what each wedge did, times, memory")
        .help_elsewhere = {{command_coverage, "JSON: inputs, parameters, what each quadrant did, times, memory"},
                           {command_scope, "JSON: inputs, parameters, times, memory"}};
    t.add("timeline", path([](auto& s) -> auto& { return s.timeline; }), "",
          "Trace Event JSON: what each thread did when, and the memory in use; opens in Perfetto");
    t.add("power-unit",
          choice<PowerUnit>(
              {{"W", PowerUnit::watt}, {"dBm", PowerUnit::dbm}}, [](auto& s) -> auto& { return s.power_unit; }),
          "W", "unit of the power image");
    t.add("of", word_of("DRIVER", &Settings::driver), "",
          "GDAL driver of the picture, or of the other rasters where no picture is written; else by the file's "
          "extension")
        .help_elsewhere = {
        {command_coverage, "GDAL driver of the output, one that writes tile by tile; else by the file's extension"}};
    {
        Key& co = t.add("co", creation(), "", "creation option of that driver; may be repeated");
        co.repeatable = true;
        co.help_elsewhere = {
            {command_tile, "GeoTIFF creation option of the store's sheets, such as COMPRESS=ZSTD; may be repeated"}};
        co.commands |= command_tile;
    }
    t.add("overwrite", flag([](auto& s) -> auto& { return s.overwrite; }), "off", "replace outputs that exist")
        .commands |= command_tile | command_evaluate;
    t.add("reproducible", flag([](auto& s) -> auto& { return s.reproducible; }), "off",
          "rasters and pictures are the same bytes every time (a report holds times): so they are without it, but by "
          "drivers that write the time or a temporary name, which it refuses");
}

void add_talk(Table& t) {
    using namespace codecs;
    using enum Dimension;
    t.group(KeyGroup::talk, false);
    {
        Key& c = t.add("config", config(), "", "GDAL configuration option; may be repeated");
        c.repeatable = true;
        c.commands |= command_info | command_tile;
    }
    t.add("profile", flag([](auto& s) -> auto& { return s.profile; }), "off",
          "tables on stderr: CPU by stage, waits, posts, bytes and memory of each wedge; and what share each stage "
          "reached of what one thread of this machine could do (stages that all threads share may exceed 100 %)")
        .help_elsewhere = {
        {command_coverage,
         "tables on stderr: CPU, waits, posts and bytes of each quadrant, or of all observers; and what share each "
         "stage reached of what one thread of this machine could do"}};
    t.add("verbose", flag([](auto& s) -> auto& { return s.verbose; }), "off", "the first of these tables");
    {
        Key& q = t.add("quiet", flag([](auto& s) -> auto& { return s.quiet; }), "off", "no progress and no remarks");
        q.letter = 'q';
        q.commands |= command_info | command_tile | command_evaluate;
    }
    {
        Key& v = t.add("verify", flag([](auto& s) -> auto& { return s.verify; }), "off",
                       "read all of a tile store and name what is damaged");
        v.commands = command_info;
        v.in_scene_file = false;
    }
    {
        Key& l = t.add("list", flag([](auto& s) -> auto& { return s.list; }), "off",
                       "the models, or one model's inputs, ranges, outputs and source");
        l.commands = command_evaluate;
        l.in_scene_file = false;
    }
    {
        Key& j = t.add("json", flag([](auto& s) -> auto& { return s.json; }), "off", "JSON on standard output");
        j.help_elsewhere = {{command_evaluate, "with --list: the list as JSON"}};
        j.commands = command_info | command_evaluate | command_budget;
        j.in_scene_file = false;
    }
    {
        Key& p = t.add("plan", flag([](auto& s) -> auto& { return s.plan; }), "off",
                       "wedges, chunks, bytes, memory and time of a simulation, without running it");
        p.commands = command_info;
        p.in_scene_file = false;
    }
    {
        Key& h = t.add("help", flag([](auto& s) -> auto& { return s.help; }), "off", "this page");
        h.letter = 'h';
        h.commands = command_simulate | command_info | command_help | command_tile | command_evaluate;
        h.in_scene_file = false;
    }
}

std::vector<Key> make_keys() {
    Table t;
    add_data_base(t);
    add_position(t);
    add_look(t);
    add_coverage(t);
    add_radar(t);
    add_antenna(t);
    add_ground(t);
    add_weather(t);
    add_receiver(t);
    add_errors(t);
    add_display(t);
    add_run(t);
    add_output(t);
    add_talk(t);
    std::vector<Key> keys = t.take();
    add_commands(keys);
    return keys;
}

}  // namespace

const char* title(KeyGroup group) {
    switch (group) {
        case KeyGroup::data_base:
            return "Data base";
        case KeyGroup::position:
            return "Position";
        case KeyGroup::look:
            return "Look";
        case KeyGroup::coverage:
            return "Coverage";
        case KeyGroup::radar:
            return "Radar";
        case KeyGroup::antenna:
            return "Antenna";
        case KeyGroup::ground:
            return "Backscatter";
        case KeyGroup::weather:
            return "Weather";
        case KeyGroup::receiver:
            return "Receiver";
        case KeyGroup::errors:
            return "The radar's own errors";
        case KeyGroup::display:
            return "Display";
        case KeyGroup::run:
            return "Run";
        case KeyGroup::output:
            return "Output";
        case KeyGroup::talk:
            return "General";
    }
    return "";
}

const std::vector<Key>& key_table() {
    static const std::vector<Key> table = make_keys();
    return table;
}

const Key* find_key(std::string_view name) {
    for (const Key& key : key_table()) {
        if (key.name == name) return &key;
    }
    return nullptr;
}

}  // namespace wedgescope
