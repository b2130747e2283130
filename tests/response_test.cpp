// The layer response of coverage: what a radar gets of each post, against closed forms and against simulate's echo image.
#include <catch2/catch.hpp>

#include <cmath>
#include <numbers>

#include "lib/coverage.hpp"
#include "lib/path_loss.hpp"
#include "lib/rain.hpp"
#include "lib/shade.hpp"
#include "tests/bare_scene.hpp"
#include "tests/refusal.hpp"
#include "tests/terrain.hpp"

using namespace wedgescope;
using Catch::Matchers::WithinAbs;
using test::MemorySource;

namespace {

constexpr double post_m = 30;

Scene scene_at(double column, double row, double height_m, double range_m) {
    Scene s;
    s.platform.xy = PointXY{column * post_m, -row * post_m};
    s.platform.altitude_m = height_m;
    s.range_m = range_m;
    s.azimuth_bins = 360;
    s.earth_k.reset();
    s.display.size = 64;
    return s;
}

struct Response {
    std::int64_t columns = 0;
    std::vector<float> dbm;
    double at(std::int64_t c, std::int64_t r) const {
        return static_cast<double>(dbm[static_cast<std::size_t>(r * columns + c)]);
    }
    /// Sum of the posts, watts.
    double sum_w() const {
        double sum = 0;
        for (const float v : dbm)
            if (v == v) sum += std::pow(10, 0.1 * (static_cast<double>(v) - 30));
        return sum;
    }
};

Response look(MemorySource& source, const Scene& scene, int threads = 1) {
    const DataBase& db = source.data_base();
    Response out;
    out.columns = db.columns;
    out.dbm.resize(static_cast<std::size_t>(db.columns * db.rows), -999);
    CoverageParams params;
    params.layer = CoverageLayer::response;
    params.threads = threads;
    cover(resolve_coverage(scene, source), source, params, [&](const CoverageTile& tile) {
        for (std::int64_t r = tile.window.rows.begin; r < tile.window.rows.end; ++r)
            for (std::int64_t c = tile.window.columns.begin; c < tile.window.columns.end; ++c)
                out.dbm[static_cast<std::size_t>(r * db.columns + c)] =
                    tile.values[(r - tile.window.rows.begin) * tile.stride + c - tile.window.columns.begin];
    });
    return out;
}

double echo_sum_w(MemorySource& source, const Scene& scene) {
    return test::sum_of(test::simulate(scene, source).echo_w);
}

}  // namespace

TEST_CASE("a post of a plain returns the radar equation of its patch", "[response]") {
    MemorySource source(301, 301, post_m, [](double, double) { return 100.0; });
    source.editable().default_class = material_by_name("material", "grass");
    Scene s = scene_at(150.3, 149.6, 1600, 5000);
    for (const LandModel land : {LandModel::constant_gamma, LandModel::ulaby_dobson}) {
        s.land = land;
        s.weather.rain_mm_h = land == LandModel::constant_gamma ? 0 : 16;
        s.weather.rain_top_m = 1000;
        const Response r = look(source, s);
        const BackscatterLaw law = class_law(material_table()[source.data_base().default_class], laws_of(s));
        for (const auto& [column, row] : {std::pair{200, 150}, {10, 20}, {151, 260}, {60, 149}}) {
            const double x = (column - 150.3) * post_m, y = (149.6 - row) * post_m, range = std::hypot(x, y, 1500);
            if (range > 5000) continue;
            const double sine = 1500 / range, g = elevation_pattern(s.radar.antenna, std::asin(sine));
            double power =
                radar_constant(s.radar) * g * g * law.factor(sine) * sine * post_m * post_m / std::pow(range, 4);
            if (s.weather.rain_mm_h > 0)
                // Below its top, 900 of 1500 m of the way down.
                power *= std::pow(10, -0.2e-3 * range * 0.6 *
                                          rain_attenuation_db_km(s.radar.frequency_hz, 16,
                                                                 Angle::radians(std::asin(sine)), horizontal_tilt));
            INFO(column << ", " << row);
            CHECK_THAT(r.at(column, row), WithinAbs(10 * std::log10(power) + 30, 0.012));
        }
    }
}

TEST_CASE("each post of rough ground returns as the facet on its sensor's side, along diagonals too", "[response]") {
    // From right above a post, so that diagonals run through posts, where two quadrants meet.
    constexpr std::int64_t edge = 141, middle = 70;
    const auto hills = test::rolling(160, 60, 23);
    const auto at_post = [&](double c, double r) { return 300 + 0.04 * post_m * c - 0.03 * post_m * r + hills(c, r); };
    MemorySource source(edge, edge, post_m, at_post);
    source.editable().default_class = material_by_name("material", "grass");
    const auto z = [&](std::int64_t c, std::int64_t r) {
        return static_cast<double>(static_cast<float>(at_post(static_cast<double>(c), static_cast<double>(r))));
    };
    Scene s = scene_at(middle, middle, 2600, 9000);
    for (const LandModel land : {LandModel::constant_gamma, LandModel::ulaby_dobson}) {
        s.land = land;
        const Response got = look(source, s);
        const BackscatterLaw law = class_law(material_table()[source.data_base().default_class], laws_of(s));
        std::size_t diagonal = 0, others = 0;
        double worst = 0;
        for (std::int64_t r = 0; r < edge; ++r)
            for (std::int64_t c = 0; c < edge; ++c) {
                if (c == middle || r == middle) continue;  // no side is the sensor's
                const std::int64_t near_c = c > middle ? c - 1 : c + 1, near_r = r > middle ? r - 1 : r + 1;
                const double dz_dx = (z(c, r) - z(near_c, r)) / static_cast<double>(c - near_c) / post_m,
                             dz_dy = (z(c, r) - z(c, near_r)) / static_cast<double>(near_r - r) / post_m;
                const double x = static_cast<double>(middle - c) * post_m, y = static_cast<double>(r - middle) * post_m,
                             up = 2600 - z(c, r), range = std::hypot(x, y, up);
                const double secant = std::hypot(1, dz_dx, dz_dy);
                const double sine = (up - dz_dx * x - dz_dy * y) / (range * secant);
                const double value = got.at(c, r);
                if (value != value) continue;
                REQUIRE(sine > 0);
                const double g = elevation_pattern(s.radar.antenna, std::asin(up / range));
                const double power = radar_constant(s.radar) * g * g * law.factor(sine) * sine * secant * post_m *
                                     post_m / std::pow(range, 4);
                worst = std::max(worst, std::abs(value - 10 * std::log10(power) - 30));
                ++(std::abs(c - middle) == std::abs(r - middle) ? diagonal : others);
            }
        INFO(diagonal << " posts on diagonals, " << others << " others");
        CHECK(diagonal > 150);
        CHECK(others > 10000);
        // Tables of pattern and law.
        CHECK(worst < 0.012);
    }
}

TEST_CASE("the posts together return what the echo image holds", "[response]") {
    const auto hills = test::rolling(250, 120, 11);
    MemorySource source(401, 401, post_m, [&](double c, double r) { return 500 + hills(c, r); });
    source.set_classes([](double c, double r) {
        return static_cast<int>(c) / 40 % 2 ? 8 : static_cast<int>(r) / 60 % 2 ? 5 : 11;  // trees, grass, towns
    });
    for (const LandModel land : {LandModel::constant_gamma, LandModel::ulaby_dobson}) {
        Scene s = scene_at(200.2, 199.7, 2500, 5800);
        s.land = land;
        s.weather.vapour_g_m3 = 7.5;
        s.quality = Quality::exact;
        CHECK_THAT(10 * std::log10(look(source, s).sum_w() / echo_sum_w(source, s)), WithinAbs(0, 0.1));
        // Of a sector and a range too, whose edges cut patches.
        s.sector = Sector{Angle::degrees(30), Angle::degrees(120)};
        s.range_start_m = 3000;
        s.radar.beam_width_error = s.radar.pulse_length_error = false;
        CHECK_THAT(10 * std::log10(look(source, s).sum_w() / echo_sum_w(source, s)), WithinAbs(0, 0.2));
    }
}

TEST_CASE("what is hidden, void or shows its back returns nothing", "[response]") {
    // A ridge across at column 200; its far side falls away from the sensor.
    MemorySource source(301, 301, post_m, [](double c, double r) {
        if (r > 250) return std::nan("");
        return 300 - 6 * std::abs(c - 200);
    });
    Scene s = scene_at(100, 150, 500, 9000);
    const Response r = look(source, s);
    CHECK(std::isfinite(r.at(150, 150)));
    CHECK(std::isnan(r.at(230, 150)));  // behind the ridge
    CHECK(std::isnan(r.at(150, 270)));  // no data
    CHECK(r.at(150, 150) > r.at(110, 40));
}

TEST_CASE("culture on a post makes it a wall, and each class returns as its own", "[response]") {
    MemorySource source(301, 301, post_m, [](double, double) { return 0.0; });
    const int urban = material_by_name("material", "urban"), grass = material_by_name("material", "grass");
    source.set_classes([&](double c, double) { return c < 150 ? urban : grass; });
    source.set_culture_height([](double c, double r) { return c == 100 && r == 150 ? 1e-3 : 0.0; });
    const Scene s = scene_at(150, 150, 1500, 9000);
    const Response r = look(source, s);
    const std::vector<ClassGamma> gamma = gamma_table(s.radar.frequency_hz, std::nullopt);
    const auto db = [](double ratio) { return 10 * std::log10(ratio); };
    CHECK_THAT(r.at(101, 150) - r.at(199, 150), WithinAbs(db(gamma[static_cast<std::size_t>(urban)].ground /
                                                             gamma[static_cast<std::size_t>(grass)].ground),
                                                          1e-3));
    CHECK_THAT(r.at(100, 150) - r.at(200, 150), WithinAbs(db(gamma[static_cast<std::size_t>(urban)].wall /
                                                             gamma[static_cast<std::size_t>(grass)].ground),
                                                          1e-3));
}

TEST_CASE("any number of threads gives the same response", "[response]") {
    const auto hills = test::rolling(900, 150, 4);
    MemorySource source(520, 300, post_m, [&](double c, double r) { return 500 + hills(c, r); });
    source.set_classes([](double c, double) { return static_cast<int>(c) % 7 + 4; });
    Scene s = scene_at(200.2, 120.7, 1500, 9000);
    s.land = LandModel::ulaby_dobson;
    const Response one = look(source, s), two = look(source, s, 2);
    for (std::size_t i = 0; i < one.dbm.size(); ++i)
        if (!(one.dbm[i] == two.dbm[i]) && (one.dbm[i] == one.dbm[i] || two.dbm[i] == two.dbm[i])) FAIL("post " << i);
}

TEST_CASE("the wind's direction is in the response of a sea", "[response]") {
    MemorySource source(301, 301, post_m, [](double, double) { return 0.0; });
    source.editable().default_class = material_by_name("material", "water");
    Scene s = scene_at(150.3, 149.6, 700, 5000);
    s.sea_state = 3;
    const Response mean = look(source, s);
    s.wind_from = Angle::degrees(70);
    const Response windy = look(source, s);
    for (const auto& [column, row] : {std::pair{250, 150}, {40, 60}, {151, 290}, {20, 149}}) {
        const double x = (column - 150.3) * post_m, y = (149.6 - row) * post_m;
        const double factor = wind_factor(s.radar.frequency_hz, Angle::radians(std::asin(700 / std::hypot(x, y, 700))),
                                          Angle::radians(std::atan2(x, y) - Angle::degrees(70).rad()));
        INFO(column << ", " << row);
        CHECK_THAT(windy.at(column, row) - mean.at(column, row), WithinAbs(10 * std::log10(factor), 0.005));
    }
}
