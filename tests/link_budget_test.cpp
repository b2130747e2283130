// The link budget of a cell: closed forms for level ground, and on hills with culture and weather the sums and products
// that a run's images must meet.
#include <fmt/format.h>
#include <catch2/catch.hpp>

#include <cmath>
#include <fstream>
#include <numbers>

#include "lib/link_budget.hpp"
#include "lib/radar_equation.hpp"
#include "lib/rain.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/in_process.hpp"
#include "tests/json.hpp"
#include "tests/terrain.hpp"

using namespace wedgescope;
using Catch::Matchers::Contains;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;
using test::MemorySource;

namespace {

constexpr double post_m = 30;

Scene scene_at(double column, double row, double height_m, double range_m) {
    Scene s;
    s.refine = false;  // parts are swept one by one: by the spokes of the whole
    s.platform.xy = PointXY{column * post_m, -row * post_m};
    s.platform.altitude_m = height_m;
    s.range_m = range_m;
    s.azimuth_bins = 720;
    s.earth_k.reset();
    s.display.size = 64;
    s.quality = Quality::exact;
    return s;
}

double db(double ratio) { return 10 * std::log10(ratio); }

/// The cell as a run over all azimuths makes it.
struct Whole {
    RunResult result;
    Whole(const Scene& scene, WedgeSource& source) {
        EngineParams params;
        params.threads = 1;
        params.beside_others = true;  // keeps what was received
        result = run(resolve(scene, source), source, params);
    }
    double of(const PolarImage<float>& image, std::int64_t a, std::int64_t r) const {
        return static_cast<double>(image.row(static_cast<std::size_t>(a))[r]);
    }
};

LinkBudget budget(const Scene& scene, WedgeSource& source, std::int64_t azimuth, std::int64_t range) {
    EngineParams params;
    params.threads = 1;
    return link_budget(resolve(scene, source), source, params, azimuth, range);
}

}  // namespace

TEST_CASE("level ground has the closed form in every line", "[budget]") {
    MemorySource source(601, 601, post_m, [](double, double) { return 100.0; });
    const ClassId grass = material_by_name("material", "grass");
    source.editable().default_class = grass;
    Scene s = scene_at(300.3, 299.6, 2100, 8500);
    s.radar.pulse_s = 2e-6;  // 300 m
    s.radar.antenna.tilt = Angle::degrees(3);
    for (const LandModel land : {LandModel::constant_gamma, LandModel::ulaby_dobson}) {
        s.land = land;
        s.weather.rain_mm_h = land == LandModel::constant_gamma ? 0 : 16;
        s.weather.rain_top_m = 1100;
        for (const std::int64_t bin : {60, 95}) {
            const LinkBudget b = budget(s, source, 123, bin);
            const double range = b.echo_range_m, sine = 2000 / range, depression = std::asin(sine);
            CHECK(b.state == State::seen);
            CHECK_THAT(b.slant_range_m,
                       WithinAbs((static_cast<double>(bin) + 0.5) * default_range_bin_m(s.radar), 1e-9));
            // The mean over the pulse, which lies a little nearer than its middle: what is near returns more.
            CHECK_THAT(b.slant_range_m - b.echo_range_m, WithinAbs(0.25 * speed_of_light_m_s * 2e-6, 6));
            CHECK_THAT(b.transmit_w * b.gain * b.wavelength_m2 * b.losses, WithinRel(radar_constant(s.radar), 1e-12));
            REQUIRE(b.parts.size() == 1);
            CHECK(b.parts[0].id == grass);
            CHECK_FALSE(b.parts[0].wall);
            const CellArea cell = cell_area(s.radar.antenna.beam, s.radar.antenna.width, s.radar.pulse_extent_m(),
                                            range, Angle::radians(depression));
            CHECK_THAT(b.level_area_m2, WithinRel(cell.pulse_m2, 1e-3));
            CHECK_THAT(db(b.parts[0].area_m2 / cell.pulse_m2), WithinAbs(0, 0.02));
            const BackscatterLaw law = class_law(material_table()[grass], laws_of(s));
            CHECK_THAT(db(b.parts[0].sigma0() / (law.factor(sine) * sine)), WithinAbs(0, 0.03));
            const double g = elevation_pattern(s.radar.antenna, depression);
            CHECK_THAT(db(b.pattern / (g * g)), WithinAbs(0, 0.03));
            if (s.weather.rain_mm_h > 0) {
                // Below its top: 1000 of 2000 m of the way.
                const double way_km = 0.5e-3 * range;
                CHECK_THAT(-db(b.rain),
                           WithinAbs(2 * way_km *
                                         rain_attenuation_db_km(s.radar.frequency_hz, 16, Angle::radians(depression),
                                                                horizontal_tilt),
                                     0.02));
                CHECK(b.rain_echo_w > 0);
            } else {
                CHECK(b.rain == 1);
                CHECK(b.rain_echo_w == 0);
            }
            CHECK(b.gases == 1);
            CHECK(b.cloud == 1);
            CHECK_THAT(b.product_w(), WithinRel(b.echo_w, 1e-6));
        }
    }
}

TEST_CASE("areas are right beside the altitude hole, with any beam and pulse", "[budget]") {
    MemorySource source(81, 81, post_m, [](double, double) { return 0.0; });
    Scene s = scene_at(40.3, 40.4, 30, 900);
    s.radar.pulse_s = 1.2e-6;
    s.gamma = Decibel(-10);
    s.range_bin_m = 5;
    const auto area_m2 = [&](double range_m, double extent_m) {
        double sum = 0;
        constexpr int steps = 20000;
        for (int i = 0; i < steps; ++i) {
            const double r = range_m - extent_m * (i + 0.5) / steps;
            if (r > 30) sum += r / std::max(0.5, std::sqrt(1 - 900 / (r * r)));
        }
        return sum / steps * s.radar.pulse_extent_m() * two_way_width(s.radar.antenna.beam).rad();
    };
    for (const double scale : {1.0, 0.3, 0.0})
        for (const double wanted_m : {100, 180, 300, 800}) {
            s.radar.pulse_length_error = s.radar.beam_width_error = scale > 0;
            s.radar.pulse_length_scale = s.radar.beam_width_scale = scale > 0 ? scale : 1;
            const auto bin = static_cast<std::int64_t>(wanted_m / *s.range_bin_m);
            const LinkBudget b = budget(s, source, 200, bin);
            INFO("scale " << scale << ", " << b.slant_range_m << " m");
            REQUIRE(b.parts.size() == 1);
            // Without the pulse's length the same total comes from the cell's own bin.
            const double extent_m = scale > 0 ? scale * s.radar.pulse_extent_m() : *s.range_bin_m;
            const double outer_m = scale > 0 ? b.slant_range_m : b.slant_range_m + extent_m / 2;
            CHECK_THAT(db(b.parts[0].area_m2 / area_m2(outer_m, extent_m)),
                       WithinAbs(0, scale > 0 ? 0.15 : 0.5));  // a bin of 5 m is a sixth of a post
            CHECK_THAT(b.product_w(), WithinRel(b.echo_w, 1e-6));
            CHECK(b.echo_range_m < b.slant_range_m + 1);
            CHECK(b.echo_range_m > 30);
            if (b.level_area_m2 > 0) CHECK_THAT(db(b.level_area_m2 / b.parts[0].area_m2), WithinAbs(0, 0.5));
        }
}

TEST_CASE("steeply below the sensor the beam on level ground is at most twice as wide as it is", "[budget]") {
    MemorySource source(301, 301, post_m, [](double, double) { return 100.0; });
    Scene s = scene_at(150, 150, 2100, 4500);
    s.radar.pulse_s = 0.2e-6;
    s.range_bin_m = 10;
    std::size_t cells = 0;
    for (const double range_m : {2060, 2200, 3000}) {
        const LinkBudget b = budget(s, source, 200, static_cast<std::int64_t>(range_m / *s.range_bin_m));
        INFO(b.slant_range_m << " m");
        REQUIRE(b.level_area_m2 > 0);
        // A = r theta_2 (c tau / 2) sec(grazing) in the pulse's middle.
        const double middle_m = b.slant_range_m - s.radar.pulse_extent_m() / 2, sine = 2000 / middle_m,
                     secant = 1 / std::sqrt(1 - sine * sine);
        cells += secant > 2 ? 1 : 0;
        CHECK_THAT(b.level_area_m2, WithinRel(middle_m * two_way_width(s.radar.antenna.beam).rad() *
                                                  s.radar.pulse_extent_m() * std::min(secant, 2.0),
                                              0.01));
    }
    CHECK(cells == 2);
}

TEST_CASE("areas are right where ground is seen nearly edge-on, by any law", "[budget]") {
    MemorySource source(601, 601, post_m, [](double, double) { return 100.0; });
    for (const LandModel land : {LandModel::constant_gamma, LandModel::ulaby_dobson}) {
        // 0.34 to 0.003 degrees.
        for (const double above_m : {50.0, 5.0, 0.5}) {
            INFO(above_m);
            Scene s = scene_at(300.3, 299.6, 100 + above_m, 8500);
            s.land = land;
            const LinkBudget b = budget(s, source, 123, 420);
            REQUIRE(b.state == State::seen);
            REQUIRE(b.parts.size() == 1);
            REQUIRE(b.level_area_m2 > 0);
            CHECK_THAT(db(b.parts[0].area_m2 / b.level_area_m2), WithinAbs(0, 0.02));
        }
    }
}

TEST_CASE("water that returns nothing is ground all the same", "[budget]") {
    MemorySource source(301, 301, post_m, [](double, double) { return 100.0; });
    source.editable().default_class = material_by_name("material", "water");
    const LinkBudget b = budget(scene_at(150, 150, 2100, 4500), source, 100, 200);
    CHECK(b.state == State::seen);
    CHECK(b.echo_w == 0);
    REQUIRE(b.parts.size() == 1);
    CHECK(b.parts[0].cross_section_m2 == 0);
    CHECK(b.parts[0].area_m2 > 100);
}

TEST_CASE("far shores and statistical walls have their place in the sum", "[budget]") {
    const int water = material_by_name("material", "water"), urban = material_by_name("material", "urban"),
              grass = material_by_name("material", "grass");
    // A lake, a bank and a town on the plain behind it.
    MemorySource source(401, 121, post_m,
                        [](double c, double) { return c < 200 ? 0.0 : std::min(20.0, 10 * (c - 200)); });
    source.set_classes([&](double c, double) { return c < 150 ? grass : c < 200 ? water : c < 206 ? grass : urban; });
    Scene s = scene_at(50, 60, 900, 9000);
    s.far_shore = true;
    s.walls = Walls::statistical;
    const Whole whole(s, source);
    const auto bin = static_cast<std::int64_t>(std::hypot(151 * post_m, 890) / default_range_bin_m(s.radar));
    bool brightened = false, town = false;
    for (const std::int64_t range : {bin, bin + 1, bin + 2, bin + 8}) {
        const LinkBudget b = budget(s, source, 180, range);
        INFO("range bin " << range);
        CHECK(b.power_w == whole.of(whole.result.power_w, 180, range));
        REQUIRE(b.echo_w > 0);
        CHECK_THAT(b.product_w(), WithinRel(b.echo_w, 1e-6));
        CHECK(b.far_shore >= 1 - 1e-6);
        double sum = 0;
        for (const LinkPart& part : b.parts) {
            sum += part.cross_section_m2;
            town = town || part.id == urban;
        }
        CHECK_THAT(db(sum / b.cross_section_m2), WithinAbs(0, 0.002));
        brightened = brightened || b.far_shore > 1.5;
    }
    CHECK(brightened);
    CHECK(town);
}

TEST_CASE("a budget adds up to the cell that a run makes", "[budget][long]") {
    const auto hills = test::rolling(250, 120, 11);
    MemorySource source(401, 401, post_m, [&](double c, double r) { return 500 + hills(c, r); });
    source.set_classes([](double c, double r) {
        return static_cast<int>(c) / 5 % 2 ? 8 : static_cast<int>(r) / 6 % 2 ? 5 : 11;  // trees, grass, towns
    });
    source.set_culture_height([](double c, double r) {
        return static_cast<int>(c) / 5 % 2 == 0 && static_cast<int>(r) / 6 % 2 == 0 ? 25.0 : 0.0;
    });
    Scene s = scene_at(200.2, 199.7, 1500, 5800);
    s.weather.vapour_g_m3 = 20;
    s.weather.rain_mm_h = 40;
    s.weather.rain_top_m = 900;
    s.weather.liquid_water_g_m3 = 1;
    s.weather.cloud_base_m = 900;
    s.weather.cloud_top_m = 1400;
    s.receiver.speckle_looks = 3;
    s.receiver.noise = true;
    s.receiver.stc_range_m = 4000;
    for (const auto& [kind, land] :
         {std::pair{DisplayKind::ppi, LandModel::ulaby_dobson}, {DisplayKind::gpi_true, LandModel::constant_gamma}}) {
        s.display.kind = kind;
        s.land = land;
        const Whole whole(s, source);
        std::size_t seen = 0, shadows = 0;
        for (std::int64_t azimuth = 3; azimuth < 720; azimuth += 190)
            for (std::int64_t range = 120; range < 300; range += 60) {
                INFO("cell " << azimuth << ", " << range);
                const LinkBudget b = budget(s, source, azimuth, range);
                // The very bits of the images.
                CHECK(b.power_w == whole.of(whole.result.power_w, azimuth, range));
                CHECK(b.received_w == whole.of(whole.result.received_w, azimuth, range));
                CHECK(b.state == static_cast<State>(whole.result.state.row(static_cast<std::size_t>(azimuth))[range]));
                CHECK(b.levels.grey == Receiver(s.receiver, s.radar).grey(b.received_w, b.slant_range_m));
                CHECK_THAT(b.echo_w + b.rain_echo_w, WithinRel(b.power_w, 1e-6));
                CHECK_THAT(b.product_w(), WithinRel(b.echo_w, 1e-6));
                shadows += b.state == State::shadow;
                if (!(b.echo_w > 0)) continue;
                ++seen;
                double sum = 0;
                for (const LinkPart& part : b.parts) sum += part.cross_section_m2;
                CHECK_THAT(db(sum / b.cross_section_m2), WithinAbs(0, 0.002));
                CHECK(b.parts.size() >= 2);
                for (const double loss : {b.gases, b.rain, b.cloud}) CHECK((loss > 0 && loss < 1));
                // Between those of the lowest and the highest ground there may be.
                const auto gases_db = [&](double ground_m) {
                    return path_loss(Weather(weather_of(s), s.radar.frequency_hz), Earth(), 1500, b.echo_range_m,
                                     (ground_m - 1500) / b.echo_range_m)
                        .gases_db;
                };
                CHECK(-db(b.gases) < gases_db(250) * 1.03);
                CHECK(-db(b.gases) > gases_db(775) * 0.97);
            }
        CHECK(seen > 8);
        CHECK(shadows > 0);
    }
    // Nearer than the receiver opens nothing is received.
    s.receiver.minimum_range_m = 4000;
    const LinkBudget near = budget(s, source, 3, 150);
    CHECK(near.blanked);
    CHECK(near.received_w == 0);
    CHECK(near.levels.grey == 0);
}

TEST_CASE("a cell without ground says so", "[budget]") {
    MemorySource source(301, 301, post_m, [](double c, double) { return c == 180 ? 400.0 : 0.0; });
    Scene s = scene_at(100, 150, 500, 9000);
    const ResolvedScene scene = resolve(s, source);
    const CellPlace behind = cell_place(scene, source, {220, 150});
    CHECK_THAT(behind.azimuth_rad, WithinAbs(std::numbers::pi / 2, 1e-12));
    CHECK_THAT(behind.range_m, WithinRel(std::hypot(120 * post_m, 500.0), 1e-12));
    CHECK(behind.surface_m == 0);
    const LinkBudget b = budget(s, source, 180, static_cast<std::int64_t>(behind.range_m / scene.shown.range_bin_m));
    CHECK(b.state == State::shadow);
    CHECK(b.echo_w == 0);
    CHECK(b.cross_section_m2 == 0);
    CHECK(b.parts.empty());
    CHECK(b.product_w() == 0);
    CHECK_THAT(b.received_w, WithinRel(s.radar.noise_power_w(), 1e-6));
    const auto level = level_place(scene, source.data_base(), behind.azimuth_rad, behind.range_m);
    REQUIRE(level);
    CHECK_THAT(level->first, WithinAbs(220 * post_m, 1e-6));
    CHECK_THAT(level->second, WithinAbs(-150 * post_m, 1e-6));
    CHECK_FALSE(level_place(scene, source.data_base(), 0, 499));  // the altitude hole
    CHECK_THROWS_AS(cell_place(scene, source, {-5, 0}), InputError);
    CHECK_THROWS(budget(s, source, 3, 1000000));
}

// ------------------------------------------------------------------------------------------------- the command

namespace {

const std::string dem = std::string(WEDGESCOPE_DATA) + "/inland_empire_dem.tif";

struct Said {
    test::Ended ended;
    std::string out;
};
Said wedgescope_says(const test::Folder& folder, std::vector<std::string> words) {
    Said said;
    const std::string out = (folder / "out.txt");
    said.ended = test::run_here(words, (folder / "err.txt"), out);
    std::ostringstream all;
    all << std::ifstream(out, std::ios::binary).rdbuf();
    said.out = all.str();
    return said;
}

}  // namespace

TEST_CASE("the budget command prints what simulate makes", "[budget]") {
    const test::Folder folder;
    const std::string scene = (folder / "scene.ini");
    std::ofstream(scene) << "dem = " << dem << "\nlatlon = 33.92,-117.28\naltitude-msl = 7000ft\nrange = 12nmi\n"
                         << "gases = normal\nrain = light\nheading = 30deg\noutput = scope.png\n";
    const Said said = wedgescope_says(folder, {"budget", scene, "--at", "200deg,8nmi", "--json"});
    INFO(said.ended.err);
    REQUIRE(said.ended.code == 0);
    const auto page = test::json_of(said.out);
    CHECK(page["format"] == "wedgescope-budget-1");
    CHECK_THAT(page["cell"]["azimuth_from_heading_deg"].get<double>(), WithinAbs(-160, 0.4));
    CHECK_THAT(page["cell"]["azimuth_deg"].get<double>(), WithinAbs(230, 0.4));
    CHECK_THAT(page["cell"]["slant_range_m"].get<double>(), WithinAbs(8 * 1852, 20));
    std::map<std::string, double> value;
    for (const auto& line : page["lines"])
        if (!line.contains("part_of") && line["value"].is_number()) value[line["name"]] = line["value"];
    double sum = 0;
    for (const char* name : {"transmitter", "antenna_gain", "wavelength", "losses", "spreading", "cross_section",
                             "elevation_pattern", "gases", "rain", "cloud"}) {
        REQUIRE(value.count(name) == 1);
        sum += value[name];
    }
    CHECK_THAT(sum, WithinAbs(value["echo"], 1e-4));
    CHECK_THAT(db(std::pow(10, value["echo"] / 10) + std::pow(10, value["rain_echo"] / 10)),
               WithinAbs(value["power"], 1e-4));
    CHECK_THAT(db(std::pow(10, value["power"] / 10) + std::pow(10, value["noise"] / 10)),
               WithinAbs(value["received"], 2e-3));
    CHECK_THAT(value["above_mds"], WithinAbs(value["received"] + value["stc"] - value["mds"], 1e-9));
    CHECK_THAT(value["if_stage"], WithinAbs(std::clamp((value["above_mds"] + value["if_gain"]) / 20, 0.0, 1.0), 1e-6));
    CHECK_THAT(value["grey_level"], WithinAbs(255 * value["video"], 0.5));

    // The power layer holds the same.
    const std::string power = (folder / "power.tif");
    REQUIRE(test::run_here({"simulate", scene, "-o", (folder / "s.png"), "--power", power, "-q"}, (folder / "err.txt"))
                .code == 0);
    GDALAllRegister();
    const std::unique_ptr<GDALDataset> image(GDALDataset::Open(power.c_str(), GDAL_OF_RASTER));
    REQUIRE(image);
    float watts = 0;
    const int column = page["cell"]["range_bin"], row = page["cell"]["azimuth_bin"];
    REQUIRE(image->GetRasterBand(1)->RasterIO(GF_Read, column, row, 1, 1, &watts, 1, 1, GDT_Float32, 0, 0, nullptr) ==
            CE_None);
    CHECK(static_cast<double>(watts) == page["watts"]["power"].get<double>());

    // The place on level ground there is in the cell, or next to it where the ground is higher or lower.
    const auto at = page["cell"]["level_lat_lon"];
    const std::string place = fmt::format("{:.6f},{:.6f}", at[0].get<double>(), at[1].get<double>());
    for (const char* option : {"--at-latlon", "--latlon"}) {
        const Said by_place = wedgescope_says(folder, {"budget", scene, option, place, "--json"});
        INFO(by_place.ended.err);
        REQUIRE(by_place.ended.code == 0);
        const auto same = test::json_of(by_place.out);
        CHECK(same["cell"]["azimuth_bin"] == page["cell"]["azimuth_bin"]);
        CHECK_THAT(same["cell"]["slant_range_m"].get<double>(), WithinAbs(8 * 1852, 200));
    }
    const Said text = wedgescope_says(folder, {"budget", scene, "--at", "200deg,8nmi"});
    CHECK_THAT(text.out,
               Contains("transmitter") && Contains("76.990 dBm   50 kW") && Contains("soil") && Contains("grey level"));
    CHECK_FALSE(std::filesystem::exists(folder / "scope.png"));
}

TEST_CASE("what budget cannot do it says in one line", "[budget]") {
    const test::Folder folder;
    const std::vector<std::string> scene = {"budget",         "--dem",  dem,       "--latlon", "33.92,-117.28",
                                            "--altitude-msl", "7000ft", "--range", "12nmi"};
    const auto refused = [&](std::vector<std::string> more, const std::string& words) {
        std::vector<std::string> all = scene;
        all.insert(all.end(), more.begin(), more.end());
        const Said said = wedgescope_says(folder, all);
        INFO(said.ended.err);
        CHECK(said.ended.code == 2);
        CHECK(std::count(said.ended.err.begin(), said.ended.err.end(), '\n') == 1);
        CHECK_THAT(said.ended.err, Contains(words));
        CHECK(said.out.empty());
    };
    refused({}, "at AZIMUTH,RANGE or at-latlon LAT,LON is needed");
    refused({"--at", "20deg"}, "AZIMUTH,RANGE");
    refused({"--at", "20deg,13nmi"}, "the scene's is 0.0 to 222");
    refused({"--at", "20,3nmi"}, "angle");
    refused({"--at", "400deg,3nmi"}, "from -360deg to 360deg");
    refused({"--at", "20deg,3nmi", "--sector", "30deg,60deg"}, "the scene's sector is 30.0000 to 60.0000 deg");
    refused({"--at", "20deg,3nmi", "--at-latlon", "33.9,-117.2"}, "exactly one");
    refused({"--at-latlon", "10,10"}, "no height is known there");
    refused({"--at", "20deg,3nmi", "--output", "x.png"}, "it is simulate's");
    refused({"--at", "20deg,3nmi", "--rings", "off"}, "it is simulate's");
    refused({"--at", "20deg,1e300m"}, "from 0m to 10000km");
}

TEST_CASE("budget takes memory for what it looks at, not for the whole scene", "[budget]") {
    const test::Folder folder;
    const auto page = [&](const char* command, const char* memory) {
        std::vector<std::string> words{command,          "--dem",  dem,       "--latlon", "33.92,-117.28",
                                       "--altitude-msl", "7000ft", "--range", "12nmi",    "--azimuth-bins",
                                       "20000",          "--beam", "0.2deg",  "--memory", memory};
        if (command == std::string("budget"))
            words.insert(words.end(), {"--at", "20deg,9nmi"});
        else
            words.insert(words.end(), {"-o", folder / "scope.png"});
        return wedgescope_says(folder, words);
    };
    const Said large = page("budget", "2GiB"), small = page("budget", "64MiB");
    INFO(small.ended.err);
    CHECK(small.ended.code == 0);
    CHECK(small.out == large.out);
    CHECK(page("simulate", "64MiB").ended.code == 2);
}

TEST_CASE("budget finds the bin of any azimuth", "[budget]") {
    const test::Folder folder;
    const auto bin = [&](std::vector<std::string> more) {
        std::vector<std::string> all = {"budget", "--dem",          dem,      "--latlon", "33.92,-117.28", "--set",
                                        "f111a",  "--altitude-msl", "7000ft", "--range",  "3nmi",          "--quality",
                                        "draft",  "--json"};
        all.insert(all.end(), more.begin(), more.end());
        const Said said = wedgescope_says(folder, all);
        INFO(said.ended.err);
        REQUIRE(said.ended.code == 0);
        return test::json_of(said.out)["cell"]["azimuth_bin"].get<int>();
    };
    CHECK(bin({"--heading", "1.1deg", "--at", "358.9deg,2nmi"}) == 0);  // north, with a sum a little below it
    CHECK(bin({"--heading", "90deg", "--at", "270deg,2nmi"}) == 0);
    CHECK(bin({"--at=-0.1deg,2nmi"}) == 959);
    CHECK(bin({"--at", "45deg,2nmi", "--sector", "-45deg,45deg"}) == 119);  // the far edge is the last bin's
    CHECK(bin({"--at", "-45deg,3nmi", "--sector", "-45deg,45deg"}) == 840);
    const Said far = wedgescope_says(
        folder, {"budget", "--dem", dem, "--latlon", "33.92,-117.28", "--altitude-msl", "7000ft", "--range", "4500m",
                 "--range-bin", "45m", "--quality", "draft", "--at", "0deg,4500m", "--json"});
    INFO(far.ended.err);
    REQUIRE(far.ended.code == 0);
    CHECK(test::json_of(far.out)["cell"]["range_bin"] == 99);  // and that of the range
}
