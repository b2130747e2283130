// Checks of the reference engine: closed forms, and (hidden, "[study]") convergence and cost on real scenes.
//   wedgescope_reference_check "[study]"      WEDGESCOPE_DATA: folder of the rasters, WEDGESCOPE_PNG: folder for pictures
#include <catch2/catch.hpp>

#include "tests/reference/reference_engine.hpp"

#include <gdal_priv.h>
#include <ogr_spatialref.h>
#include <GeographicLib/Geodesic.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

using namespace wedgescope::reference;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

constexpr double pi = std::numbers::pi;
constexpr double deg = pi / 180;
constexpr double c_m_s = 299792458.0;
constexpr double void_value = -9999;

struct Grid {
    int columns, rows;
    double x0, y0;  // of the post in column 0, row 0
    double dx, dy;  // dy is negative north-up
    int epsg;       // 0: none
};

/// Writes a raster to memory; height(x, y, column, row).
std::string write(const std::string& name, const Grid& g,
                  const std::function<double(double, double, int, int)>& height) {
    GDALAllRegister();
    const std::string path = "/vsimem/" + name + ".tif";
    GDALDriver* driver = GetGDALDriverManager()->GetDriverByName("GTiff");
    GDALDataset* file = driver->Create(path.c_str(), g.columns, g.rows, 1, GDT_Float64, nullptr);
    REQUIRE(file != nullptr);
    double transform[6] = {g.x0 - 0.5 * g.dx, g.dx, 0, g.y0 - 0.5 * g.dy, 0, g.dy};
    file->SetGeoTransform(transform);
    if (g.epsg != 0) {
        OGRSpatialReference crs;
        crs.importFromEPSG(g.epsg);
        file->SetSpatialRef(&crs);
    }
    file->GetRasterBand(1)->SetNoDataValue(void_value);
    std::vector<double> line(static_cast<std::size_t>(g.columns));
    for (int r = 0; r < g.rows; ++r) {
        for (int c = 0; c < g.columns; ++c)
            line[static_cast<std::size_t>(c)] = height(g.x0 + c * g.dx, g.y0 + r * g.dy, c, r);
        REQUIRE(file->GetRasterBand(1)->RasterIO(GF_Write, 0, r, g.columns, 1, line.data(), g.columns, 1, GDT_Float64,
                                                 0, 0, nullptr) == CE_None);
    }
    GDALClose(file);
    return path;
}

/// A plain of local metres, posts every 30 m, 601 x 601, the origin in the middle.
constexpr Grid local{601, 601, -9000, 9000, 30, -30, 0};

Scene local_scene(const std::string& dem, double height_m) {
    Scene s;
    s.dem = dem;
    s.by_xy = true;
    s.height_msl_m = height_m;
    s.geometry = Geometry::grid;
    s.flat_earth = true;
    s.gamma = constant_gamma(-15);
    s.azimuth_count = 4;
    s.range_bins = 480;
    s.rays_per_bin = 12;
    s.step_posts = 0.25;
    return s;
}

/// Pt G0^2 lambda^2 / ((4 pi)^3 Ls)
double radar_constant(const Scene& s) {
    const double lambda = c_m_s / (s.frequency_ghz * 1e9);
    return s.transmit_power_w * std::pow(10, (2 * s.gain_db - s.losses_db) / 10) * lambda * lambda /
           std::pow(4 * pi, 3);
}
double linear_gamma(const Scene& s, double db) {
    return std::pow(10, (db + 5 * std::log10(s.frequency_ghz / 10)) / 10);
}

/// A pattern so wide that it is 1 everywhere.
void isotropic(Scene& s) {
    s.elevation_pattern = ElevationPattern::gaussian;
    s.width_deg = 1e9;
}

double sum_echo_r2(const Scene& s, const Result& r, int azimuth) {
    double sum = 0;
    for (int j = 0; j < s.range_bins; ++j) {
        const double range = (j + 0.5) * s.range_bin_m;
        sum += r.echo_w[r.index(azimuth, j)] * range * range;
    }
    return sum;
}

double db(double a, double b) { return 10 * std::log10(a / b); }

}  // namespace

TEST_CASE("a flat plain returns the pulse-limited radar equation", "[reference]") {
    Scene s = local_scene(write("plain", local, [](double, double, int, int) { return 100.0; }), 1100);
    s.elevation_pattern = GENERATE(ElevationPattern::csc2, ElevationPattern::cos_csc2, ElevationPattern::gaussian);
    s.tilt_deg = GENERATE(0.0, 3.0);
    // The Gaussian falls by 4 dB in 19 m at steep depressions, but echoes count as spread evenly over their bin.
    const int finer = s.elevation_pattern == ElevationPattern::gaussian ? 8 : 1;
    s.range_bin_m /= finer;
    s.range_bins *= finer;
    s.step_posts /= finer;
    const Result result = simulate(s);
    CHECK(result.reference_height_m == 100);
    const double height = 1000;
    const double tau_m = c_m_s * s.pulse_s / 2;
    double worst = 0;
    // From 1.3 times the altitude (cos d above 1/2) to the edge of the plain.
    for (int j = 90 * finer; j < 460 * finer; j += finer) {
        // The mean of the closed form over the pulse and over the bin.
        const double far = (j + 1) * s.range_bin_m;
        double expected = 0;
        const int n = 400;
        for (int i = 0; i < n; ++i) {
            for (int k = 0; k < 8; ++k) {
                const double r = far - (k + 0.5) / 8 * s.range_bin_m - (i + 0.5) / n * tau_m;
                const double d = std::asin(height / r);
                const double g = elevation_gain(s, d);
                const double theta2 = s.beamwidth_deg * deg * std::sqrt(pi / (8 * std::numbers::ln2));
                const double area = r * theta2 * tau_m / std::cos(d);
                expected +=
                    radar_constant(s) * g * g * linear_gamma(s, -15) * std::sin(d) * area / std::pow(r, 4) / (8.0 * n);
            }
        }
        for (int i = 0; i < s.azimuth_count; ++i)
            worst = std::max(worst, std::abs(db(result.power_w[result.index(i, j)], expected)));
    }
    CHECK(worst < 0.005);
}

TEST_CASE("the constant-return pattern returns the same power from everywhere on a flat plain", "[reference]") {
    Scene s = local_scene(write("plain", local, [](double, double, int, int) { return 0.0; }), 2000);
    s.elevation_pattern = ElevationPattern::cos_csc2;
    const Result result = simulate(s);
    for (int j = 160; j < 460; ++j)  // depressions 42 .. 13 degrees
        CHECK_THAT(db(result.power_w[result.index(1, j)], result.power_w[result.index(1, 300)]), WithinAbs(0, 0.15));
}

TEST_CASE("the echoes of rough ground add up to gamma times its solid angle, whatever the slopes", "[reference]") {
    // Noise of 200 m from post to post, in front of a straight ridge that stands above all of it.
    const double sensor = 1500, ridge_y = 7500, ridge = 1400;
    std::mt19937 random(5);
    const std::string dem = write("rough", local, [&](double, double y, int, int) {
        const double noise = 200.0 * static_cast<double>(random() % 1000) / 1000;
        return std::abs(y - ridge_y) < 1 ? ridge : noise;
    });
    Scene s = local_scene(dem, sensor);
    isotropic(s);
    s.rays_per_bin = 40;
    s.range_bin_m = 0.5;
    s.range_bins = 20000;
    s.azimuth_count = 2;
    s.beam = s.pulse = false;
    s.split_steps = GENERATE(true, false);
    s.step_posts = s.split_steps ? 0.25 : 1.0 / 64;
    const Result result = simulate(s);
    for (int i = 0; i < s.azimuth_count; ++i) {
        double solid_angle = 0;
        for (int k = 0; k < s.rays_per_bin; ++k) {
            const double azimuth = 2 * pi / s.azimuth_bins * (i + (k + 0.5) / s.rays_per_bin);
            const double sin_e = (ridge - sensor) / std::hypot(ridge - sensor, ridge_y / std::cos(azimuth));
            solid_angle += 2 * pi / s.azimuth_bins / s.rays_per_bin * (sin_e + 1);
        }
        const double expected = radar_constant(s) * linear_gamma(s, -15) * solid_angle;
        CHECK_THAT(sum_echo_r2(s, result, i),
                   WithinRel(expected, s.split_steps ? 3e-5 : 2e-3));  // uniform steps miss 11 m of the ridge
    }
}

TEST_CASE("a wall throws a shadow of the length of similar triangles and returns gamma_w from its face",
          "[reference]") {
    // One row of posts with culture 60 m high, 3000 m north of a sensor 500 m up: shadow to 3000 * 500 / 440 m.
    const double sensor = 500, wall_y = 3000, wall = 60;
    Scene s = local_scene(write("plain", local, [](double, double, int, int) { return 0.0; }), sensor);
    // The cells that azimuth bin 0 crosses lie between the columns at x = 0 and x = 30. The taller post owns them, on a
    // tie that of the smaller column.
    const double extra = GENERATE(0.0, 1e-6);
    s.culture = write("codes", local, [&](double x, double y, int, int) {
        return std::abs(y - wall_y) > 1 ? 5.0 : x < 1 ? 11.0 : 8.0;
    });
    s.culture_height = write("heights", local, [&](double x, double y, int, int) {
        return std::abs(y - wall_y) > 1 ? 0.0 : 10 * (wall + (x < 1 ? 0 : extra));
    });
    s.culture_height_scale = 0.1;
    s.class_of_code = {{5, 5}, {8, 8}, {11, 11}};
    s.gamma = {{4, {-17, none}}, {5, {none, none}}, {8, {-3, none}}, {11, {-90, 5}}};  // 8: its walls take its gamma
    const double wall_db = extra > 0 ? -3 : 5;
    isotropic(s);
    s.beam = s.pulse = false;
    s.range_bin_m = 2;
    s.range_bins = 3000;
    s.azimuth_count = 2;
    const Result result = simulate(s);

    const double foot = std::hypot(wall_y - 30, sensor);
    const double crest = std::hypot(wall_y, sensor - wall);
    const double end = std::hypot(wall_y * sensor / (sensor - wall), sensor);
    const double expected = radar_constant(s) * linear_gamma(s, wall_db) * 2 * pi / s.azimuth_bins *
                            ((wall - sensor) / crest + sensor / foot);
    CHECK_THAT(sum_echo_r2(s, result, 0), WithinRel(expected, 1e-3));

    int first_shadow = -1, last_shadow = -1;
    for (int j = 0; j < s.range_bins; ++j) {
        const auto state = result.state[result.index(0, j)];
        if (state == shadow) {
            if (first_shadow < 0) first_shadow = j;
            last_shadow = j;
        }
        if (j * s.range_bin_m > end + 5) CHECK(state == seen);
        if ((j + 1) * s.range_bin_m < sensor) CHECK(state == outside);
    }
    // The face leans towards the sensor in slant range: foot beyond crest, so the shadow starts behind the foot.
    CHECK_THAT(first_shadow * s.range_bin_m, WithinAbs(std::max(foot, crest), 3));
    CHECK_THAT((last_shadow + 1) * s.range_bin_m, WithinAbs(end, 3));
}

TEST_CASE("a smooth earth is seen to the tangent point and hidden beyond", "[reference]") {
    // Posts of 0.01 degrees on the ellipsoid; K = 4/3.
    Scene s;
    s.dem = write("sea", {700, 700, 10, 50, 0.01, -0.01, 4326}, [](double, double, int, int) { return 0.0; });
    s.lat_deg = 46.5;
    s.lon_deg = 13.5;
    s.height_msl_m = 3000;
    s.gamma = constant_gamma(-15);
    isotropic(s);
    s.beam = s.pulse = false;
    s.azimuth_bins = 36;
    s.azimuth_count = 36;
    s.range_bin_m = 100;
    s.range_bins = 2600;
    s.rays_per_bin = 2;
    const Result result = simulate(s);
    for (const int i : {0, 4, 9, 20}) {
        int last_seen = 0;
        for (int j = 0; j < s.range_bins; ++j)
            if (result.state[result.index(i, j)] == seen) last_seen = j;
        // Euler radius of a ray in the bin.
        const double azimuth = (i + 0.25) * 10 * deg, lat = s.lat_deg * deg, a = 6378137, f = 1 / 298.257223563;
        const double w = 1 - f * (2 - f) * std::pow(std::sin(lat), 2);
        const double m = a * (1 - f) * (1 - f) / std::pow(w, 1.5), n = a / std::sqrt(w);
        const double re = 4.0 / 3 / (std::pow(std::cos(azimuth), 2) / m + std::pow(std::sin(azimuth), 2) / n);
        const double tangent = std::sqrt(s.height_msl_m * (2 * re + s.height_msl_m));
        CHECK_THAT((last_seen + 1) * s.range_bin_m, WithinAbs(tangent, 500));  // a step is 190 m, a bin 100 m
        CHECK(result.state[result.index(i, last_seen + 20)] == shadow);
        const double solid_angle = 2 * pi / 36 * (1 - tangent / (re + s.height_msl_m));
        CHECK_THAT(sum_echo_r2(s, result, i), WithinRel(radar_constant(s) * linear_gamma(s, -15) * solid_angle, 1e-3));
    }
}

TEST_CASE("a mast stands at its geodesic azimuth and at the slant range of the effective earth", "[reference]") {
    // One post 300 m high on a plain of UTM zone 33, 25 km from the nadir; only the mast's cells return.
    const Grid utm{1001, 1001, 485000, 5415000, 30, -30, 32633};
    const int column = 900, row = 200;
    Scene s;
    s.dem = write("utm", utm, [](double, double, int, int) { return 0.0; });
    s.culture =
        write("mast_code", utm, [&](double, double, int c, int r) { return c == column && r == row ? 15.0 : 0.0; });
    s.culture_height =
        write("mast", utm, [&](double, double, int c, int r) { return c == column && r == row ? 300.0 : 0.0; });
    s.class_of_code = {{0, 0}, {15, 15}};
    s.gamma = project_gamma();
    s.lat_deg = 48.70;
    s.lon_deg = 14.9;
    s.height_msl_m = 2000;
    isotropic(s);
    s.beam = s.pulse = false;
    s.azimuth_bins = 36000;
    s.range_bin_m = 1;
    s.range_bins = 28000;
    s.rays_per_bin = 3;

    OGRSpatialReference from, to;
    from.importFromEPSG(32633);
    to.importFromEPSG(4326);
    to.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    OGRCoordinateTransformation* t = OGRCreateCoordinateTransformation(&from, &to);
    double lon = utm.x0 + column * utm.dx, lat = utm.y0 + row * utm.dy;
    REQUIRE(t->Transform(1, &lon, &lat));
    OGRCoordinateTransformation::DestroyCT(t);
    double arc = 0, azimuth = 0, unused = 0;
    GeographicLib::Geodesic::WGS84().Inverse(s.lat_deg, s.lon_deg, lat, lon, arc, azimuth, unused);
    REQUIRE(arc > 15000);

    s.first_azimuth_bin = static_cast<int>(azimuth * 100) - 20;
    s.azimuth_count = 41;
    const Result result = simulate(s);
    // Centre of the echo's azimuth, and its nearest range (the mast leans towards the sensor).
    double sum = 0, moment = 0;
    int nearest = s.range_bins;
    for (int i = 0; i < s.azimuth_count; ++i) {
        for (int j = 0; j < s.range_bins; ++j) {
            const double e = result.echo_w[result.index(i, j)];
            sum += e;
            moment += e * (s.first_azimuth_bin + i + 0.5) / 100;
            if (e > 0 && i == 20) nearest = std::min(nearest, j);
        }
    }
    CHECK_THAT(moment / sum, WithinAbs(azimuth, 0.003));  // 0.003 degrees is a metre
    const double a = 6378137, f = 1 / 298.257223563, w = 1 - f * (2 - f) * std::pow(std::sin(s.lat_deg * deg), 2);
    const double m = a * (1 - f) * (1 - f) / std::pow(w, 1.5), n = a / std::sqrt(w);
    const double re = 4.0 / 3 / (std::pow(std::cos(azimuth * deg), 2) / m + std::pow(std::sin(azimuth * deg), 2) / n);
    const double q = 2 * std::pow(std::sin(arc / re / 2), 2);
    const double r_top = std::sqrt(1700.0 * 1700.0 + 2 * q * (re + 2000) * (re + 300));
    // The crest is one end of the echo of the near face, the foot the other.
    int farthest = 0;
    for (int j = 0; j < s.range_bins; ++j)
        if (result.echo_w[result.index(20, j)] > 0) farthest = j;
    CHECK(std::min(std::abs(nearest - r_top), std::abs(farthest + 1 - r_top)) < 1.5);
    CHECK(result.position_error_posts < 1e-4);
}

TEST_CASE("a void hides nothing, returns nothing, and leaves what it may hide unknown", "[reference]") {
    // A plain at 0 m with a block of voids from 3015 to 4005 m north; one post 50 m high at the void's far rim.
    const bool rim = GENERATE(false, true);
    const std::string dem = write("voids", local, [&](double, double y, int, int) {
        if (y > 3010 && y < 4010) return void_value;
        return rim && std::abs(y - 4020) < 1 ? 50.0 : 0.0;
    });
    Scene s = local_scene(dem, 500);
    isotropic(s);
    s.beam = s.pulse = false;
    s.range_bin_m = 5;
    s.range_bins = 1700;
    s.azimuth_count = 1;
    s.split_steps = GENERATE(true, false);
    const Result result = simulate(s);
    const auto at = [&](double y) { return result.state[result.index(0, static_cast<int>(std::hypot(y, 500) / 5))]; };
    const auto echo = [&](double y) {
        return result.echo_w[result.index(0, static_cast<int>(std::hypot(y, 500) / 5))];
    };
    CHECK(at(2900) == seen);
    CHECK(at(3200) == no_data);
    CHECK(at(3900) == no_data);
    CHECK(echo(3500) == 0);
    if (!rim) {
        CHECK(at(4100) == seen);  // level ground rises in elevation
        CHECK(echo(4100) > 0);
    } else {
        // Behind the rim: shadow to 4020 * 500 / 450 = 4467 m, and nothing there is higher than the rim looks.
        CHECK(at(4300) == shadow);
        CHECK(at(4550) == seen);
        for (double y = 3050; y < 4330; y += 3) CHECK(echo(y) == 0);  // no deposit; uniform steps miss some of the rim
    }
    // Outside the posts: 9000 m north is the last row.
    CHECK(result.state[result.index(0, 1699)] == seen);  // 8500 m
}

TEST_CASE("ground below the highest post round a void is unknown and keeps its echo", "[reference]") {
    // A dam of 80 m one row before the void and on its valid posts; behind the void the plain shows below its top.
    const std::string dem = write("dam", local, [&](double x, double y, int, int) {
        if (y > 3010 && y < 4010 && x < 2000) return void_value;
        return std::abs(y - 3540) < 1 && x > 2000 ? 0.0 : (y > 2980 && y < 3010 ? 80.0 : 0.0);
    });
    Scene s = local_scene(dem, 500);
    isotropic(s);
    s.beam = s.pulse = false;
    s.range_bin_m = 5;
    s.range_bins = 1700;
    s.azimuth_count = 1;
    const Result result = simulate(s);
    // Top of 80 m at the void's far end (4020 m) looks as high as the plain at 4020 * 500 / 420 = 4786 m.
    const auto at = [&](double y) { return result.state[result.index(0, static_cast<int>(std::hypot(y, 500) / 5))]; };
    const auto echo = [&](double y) {
        return result.echo_w[result.index(0, static_cast<int>(std::hypot(y, 500) / 5))];
    };
    CHECK(at(4100) == unknown);
    CHECK(at(4700) == unknown);
    CHECK(echo(4700) > 0);
    CHECK(at(4860) == seen);
}

TEST_CASE("over a void the reference height is 0 and the first ground raises the horizon without an echo",
          "[reference]") {
    const std::string dem = write("hole", local, [](double x, double y, int, int) {
        return std::max(std::abs(x), std::abs(y)) < 1000 ? void_value : 100.0;
    });
    Scene s = local_scene(dem, 600);
    isotropic(s);
    s.beam = s.pulse = false;
    s.range_bin_m = 5;
    s.range_bins = 1700;
    s.azimuth_count = 1;
    const Result result = simulate(s);
    CHECK(result.reference_height_m == 0);
    const auto at = [&](double r) { return result.state[result.index(0, static_cast<int>(r / 5))]; };
    CHECK(at(595) == outside);
    CHECK(at(610) == no_data);  // a level surface at 0 m begins at 600 m
    CHECK(at(std::hypot(1020, 500) - 10) == no_data);
    CHECK(at(std::hypot(1020, 500) + 10) == seen);
    const double solid_angle = 2 * pi / s.azimuth_bins * (500 / std::hypot(1020, 500) - 500 / 8497.5);
    double sum = 0;
    for (int j = 0; j < s.range_bins; ++j) sum += result.echo_w[result.index(0, j)] * std::pow((j + 0.5) * 5, 2);
    CHECK_THAT(sum, WithinRel(radar_constant(s) * linear_gamma(s, -15) * solid_angle, 1e-3));
}

TEST_CASE("outside the posts there is no data, out to the range limit; before the first echo nothing", "[reference]") {
    Scene s = local_scene(write("plain", local, [](double, double, int, int) { return 0.0; }), 500);
    s.range_bins = 800;  // 15 km
    const Result result = simulate(s);
    for (int j = 0; j < s.range_bins; ++j) {
        const double near = j * s.range_bin_m, far = near + s.range_bin_m;
        const auto state = result.state[result.index(0, j)];
        INFO(near);
        if (far < 500) CHECK(state == outside);
        if (near > 500 && far < 9000) CHECK(state == seen);
        if (near > 9050) CHECK(state == no_data);
    }
}

TEST_CASE("a sensor outside the raster sees it", "[reference]") {
    Scene s = local_scene(write("plain", local, [](double, double, int, int) { return 20.0; }), 500);
    s.y = -12000;
    s.range_bins = 400;
    const Result result = simulate(s);
    CHECK(result.reference_height_m == 0);
    CHECK(result.state[result.index(0, 100)] == no_data);
    CHECK(result.state[result.index(0, 300)] == seen);
    CHECK(result.echo_w[result.index(0, 300)] > 0);
}

TEST_CASE("the class of a point is that of the culture cell that contains it, on the culture's own grid",
          "[reference]") {
    // Culture cells of 70 m, shifted; class 15 north of a cell edge at y = 5012.
    Scene s = local_scene(write("plain", local, [](double, double, int, int) { return 0.0; }), 500);
    const Grid other{300, 300, -10000 + 35, 12012 - 35, 70, -70, 0};
    s.culture = write("other", other, [](double, double y, int, int) { return y > 5012 ? 15.0 : void_value; });
    s.class_of_code = {{15, 15}};
    s.gamma = {{4, {none, none}}, {15, {0, none}}};
    s.beam = s.pulse = false;
    s.range_bin_m = 1;
    s.range_bins = 8000;
    s.azimuth_count = 1;
    const Result result = simulate(s);
    int first = 0;
    while (result.echo_w[result.index(0, first)] == 0) ++first;
    CHECK_THAT(first, WithinAbs(std::hypot(5012, 500), 1.5));
}

TEST_CASE("an even grid over the ground returns what rays do, the nearer the finer it is", "[reference]") {
    // A plain from high up, and rough ground, with shadows, from low down.
    const bool rough = GENERATE(false, true);
    std::mt19937 random(3);
    Scene s = local_scene(write("plain", local, [&](double, double, int, int) { return rough ? random() % 20 : 0; }),
                          rough ? 700 : 3000);
    s.first_azimuth_bin = 100;
    s.azimuth_count = 16;
    s.range_bins = 460;
    if (rough) s.rays_per_bin = 48, s.step_posts = 0.125;
    const Result rays = simulate(s);
    const auto off_db = [&](double posts) {
        s.uniform_posts = posts;
        const Result grid = simulate(s);
        double squares = 0;
        int count = 0;
        for (int i = 0; i < s.azimuth_count; ++i)
            for (int j = 250; j < 450; ++j, ++count)
                squares += std::pow(db(grid.power_w[grid.index(i, j)], rays.power_w[rays.index(i, j)]), 2);
        return std::sqrt(squares / count);
    };
    const double coarse = off_db(1), middle = off_db(0.5), fine = off_db(0.25);
    INFO(coarse << ", " << middle << ", " << fine << " dB");
    CHECK(fine < (rough ? 0.15 : 0.03));
    CHECK(middle < coarse);
    CHECK(fine < middle);
}

TEST_CASE("beam and pulse spread power and lose none", "[reference]") {
    std::mt19937 random(7);
    Scene s = local_scene(write("noise", local, [&](double, double, int, int) { return random() % 100; }), 800);
    s.azimuth_pattern = GENERATE(AzimuthPattern::gaussian, AzimuthPattern::uniform);
    s.range_bin_m = GENERATE(18.737028625, 40.0, 100.0);  // 4, 1.87, 0.75 bins a pulse
    s.range_bins = static_cast<int>(8500 / s.range_bin_m);
    s.azimuth_bins = GENERATE(90, 181);
    s.beamwidth_deg = 9;
    s.first_azimuth_bin = -5;
    s.azimuth_count = s.azimuth_bins;  // the whole circle: the skirt laps
    s.rays_per_bin = 2;
    const Result on = simulate(s);
    s.beam = false;
    const Result beam_off = simulate(s);
    s.pulse = false;
    const Result off = simulate(s);
    for (int j = 0; j < s.range_bins; ++j) {
        double a = 0, b = 0;
        for (int i = 0; i < s.azimuth_count; ++i) {
            a += on.power_w[on.index(i, j)];
            b += beam_off.power_w[on.index(i, j)];
        }
        if (b > 0) CHECK_THAT(a, WithinRel(b, 1e-12));
    }
    const double bins_a_pulse = c_m_s * s.pulse_s / 2 / s.range_bin_m;
    // What the pulse takes past the range limit is missing.
    double a = 0, b = 0;
    const auto reach = static_cast<int>(bins_a_pulse + 2);
    for (int j = 0; j < s.range_bins; ++j) {
        a += beam_off.power_w[on.index(3, j)];
        b += off.power_w[on.index(3, j)];
    }
    double tail = 0;
    for (int j = s.range_bins - reach; j < s.range_bins; ++j) tail += off.power_w[on.index(3, j)];
    CHECK(a <= b * (1 + 1e-12));
    CHECK(a >= b - tail);
}

TEST_CASE("a beam over one strong cell has the two-way pattern", "[reference]") {
    // Only culture cells round (0, 6000) return.
    Scene s = local_scene(write("plain", local, [](double, double, int, int) { return 0.0; }), 1000);
    s.culture = write("spot", local,
                      [](double x, double y, int, int) { return std::hypot(x, y - 6000) < 20 ? 15.0 : void_value; });
    s.class_of_code = {{15, 15}};
    s.gamma = {{4, {none, none}}, {15, {0, none}}};
    s.azimuth_bins = 3600;
    s.beamwidth_deg = 6;  // the cell is 0.3 degrees wide
    s.first_azimuth_bin = -40;
    s.azimuth_count = 80;
    s.rays_per_bin = 8;
    const Result result = simulate(s);
    const int j = static_cast<int>(std::hypot(6000, 1000) / s.range_bin_m) + 2;
    const double cos_d = 6000 / std::hypot(6000, 1000);
    const auto p = [&](int i) { return result.power_w[result.index(i, j)]; };
    CHECK_THAT(db(p(44), p(35)), WithinAbs(0, 0.05));  // symmetric about north: 4.5 and -4.5 bins
    const double expected = -8 * std::numbers::ln2 * 10 / std::numbers::ln10 * cos_d * cos_d *
                            (3.05 * 3.05 - 0.55 * 0.55) / (s.beamwidth_deg * s.beamwidth_deg);
    CHECK_THAT(db(p(70), p(45)), WithinAbs(expected, 0.05));
}

TEST_CASE("a scene is the same across the antimeridian, on a cyclic raster, and south up", "[reference]") {
    std::mt19937 random(11);
    std::vector<double> noise(3600 * 200);
    for (double& h : noise) h = static_cast<double>(random() % 700);
    const auto height = [&](int column, int row) {
        return noise[static_cast<std::size_t>(row * 3600 + ((column % 3600) + 3600) % 3600)];
    };
    // A world of 0.1 degree columns between 40 and 60 degrees north, whose column 0 is 0 degrees east.
    Scene s;
    s.lat_deg = 50.03;
    s.lon_deg = 179.97;
    s.height_msl_m = 9000;
    s.gamma = constant_gamma(-15);
    s.azimuth_count = 240;
    s.range_bins = 1000;
    s.range_bin_m = 200;
    s.rays_per_bin = 2;
    s.dem = write("around", {200, 200, 170, 60, 0.1, -0.1, 4326},
                  [&](double, double, int c, int r) { return height(1700 + c, r); });
    const Result plain = simulate(s);
    s.lon_deg = -180.03;
    const Result negative = simulate(s);
    CHECK(compare(negative.power_w, plain.power_w, 1e-16).rms_db < 1e-6);
    s.dem = write("cyclic", {3600, 200, -180, 60, 0.1, -0.1, 4326},
                  [&](double, double, int c, int r) { return height(1800 + c, r); });
    const Result cyclic = simulate(s);
    CHECK(compare(cyclic.power_w, plain.power_w, 1e-16).rms_db < 1e-6);
    CHECK(state_difference(cyclic.state, plain.state) < 1e-3);
    s.dem = write("repeats", {3601, 200, -180, 60, 0.1, -0.1, 4326},
                  [&](double, double, int c, int r) { return height(1800 + c, r); });
    CHECK(compare(simulate(s).power_w, plain.power_w, 1e-16).rms_db < 1e-6);
    s.dem = write("south_up", {200, 200, 170, 40.1, 0.1, 0.1, 4326},
                  [&](double, double, int c, int r) { return height(1700 + c, 199 - r); });
    CHECK(compare(simulate(s).power_w, plain.power_w, 1e-16).rms_db < 1e-6);
}

TEST_CASE("geodesic geometry on a small local grid agrees with grid geometry turned by the meridian convergence",
          "[reference]") {
    // On the central meridian of UTM the scale is 0.9996: the same picture but for 4e-4 of range.
    const Grid utm{801, 801, 488000, 5412000, 30, -30, 32633};
    Scene s;
    s.dem = write("bumps", utm,
                  [](double x, double y, int, int) { return 300 + 80 * std::sin(x / 900) * std::cos(y / 700); });
    s.by_xy = true;
    s.x = 500000;
    s.y = 5400000;
    s.height_msl_m = 1500;
    s.gamma = constant_gamma(-15);
    s.range_bins = 500;
    const Result geodesic = simulate(s);
    s.geometry = Geometry::grid;
    const Result grid = simulate(s);
    const Comparison c = compare(geodesic.power_w, grid.power_w, noise_w(2.4e6, 8));
    CHECK(std::abs(c.median_db) < 0.02);
    CHECK(c.rms_db < 0.5);
}

TEST_CASE("threads change no bit", "[reference]") {
    std::mt19937 random(7);
    Scene s = local_scene(write("noise", local, [&](double, double, int, int) { return random() % 100; }), 800);
    s.azimuth_count = 30;
    s.threads = 1;
    const Result one = simulate(s);
    s.threads = 3;
    const Result three = simulate(s);
    CHECK(one.echo_w == three.echo_w);
    CHECK(one.power_w == three.power_w);
    CHECK(one.state == three.state);
}

TEST_CASE("a comparison counts the cells above the noise", "[reference]") {
    const double noise = 1;
    const Comparison c = compare({0.5, 9, 99, 1}, {0.9, 9, 9, 0}, noise);
    CHECK(c.count == 2);
    CHECK_THAT(c.rms_db, WithinAbs(10 / std::sqrt(2.0), 1e-12));
    CHECK_THAT(c.median_db, WithinAbs(5, 1e-12));
    CHECK_THAT(c.p99_db, WithinAbs(10, 1e-12));
    CHECK(state_difference({1, 2, 3, 4}, {1, 2, 3, 3}) == 0.25);
    CHECK_THAT(10 * std::log10(noise_w(1, 0) * 1e3), WithinAbs(-173.975, 0.001));
}

TEST_CASE("bad scenes are refused", "[reference]") {
    Scene s = local_scene(write("plain", local, [](double, double, int, int) { return 0.0; }), -5);
    CHECK_THROWS(simulate(s));  // below the terrain
    s.height_msl_m = 500;
    s.geometry = Geometry::geodesic;
    CHECK_THROWS(simulate(s));  // no CRS
    s.geometry = Geometry::grid;
    s.gamma.clear();
    CHECK_THROWS(simulate(s));  // no gamma
    s.dem = "/vsimem/missing.tif";
    CHECK_THROWS(simulate(s));
}

// ---------------------------------------------------------------------------------------------------------
// Study on real scenes

namespace {

std::string data(const std::string& name) {
    const char* folder = std::getenv("WEDGESCOPE_DATA");
    return std::string(folder != nullptr ? folder : "/work/shared/data") + "/" + name;
}

struct Named {
    std::string name;
    Scene scene;
};

std::vector<Named> real_scenes() {
    std::vector<Named> scenes;
    Scene s;
    s.gamma = project_gamma();
    s.class_of_code = fbfm40_classes();
    s.culture_height_scale = 0.1;

    s.dem = data("inland_empire_dem.tif");
    s.culture = data("inland_empire_culture.tif");
    s.culture_height = data("inland_empire_canopy.tif");
    s.lat_deg = 33.83;
    s.lon_deg = -117.55;
    s.first_azimuth_bin = 320;  // 120 .. 210 degrees: Santa Ana Mountains
    s.azimuth_count = 240;
    s.range_bins = 1600;  // 30 km
    s.height_msl_m = 2134;
    scenes.push_back({"inland_high", s});
    s.height_msl_m = 838;
    scenes.push_back({"inland_low", s});

    s.dem = data("worcester_vermont_dem.tif");
    s.culture = data("worcester_vermont_culture.tif");
    s.culture_height = data("worcester_vermont_canopy.tif");
    s.lat_deg = 44.40;
    s.lon_deg = -72.56;
    s.height_msl_m = 1400;
    s.first_azimuth_bin = -120;
    s.range_bins = 600;
    scenes.push_back({"worcester", s});

    s.culture.clear();
    s.culture_height.clear();
    s.dem = data("olympic_coast_dem.tif");
    s.gamma = constant_gamma(-15);
    s.lat_deg = 48.2;
    s.lon_deg = -124.7;
    s.height_msl_m = 1500;
    s.first_azimuth_bin = 120;
    s.range_bins = 1600;
    scenes.push_back({"olympic", s});
    return scenes;
}

void write_png(const std::string& name, const Result& r, const std::vector<double>& watts, double noise) {
    const char* folder = std::getenv("WEDGESCOPE_PNG");
    if (folder == nullptr) return;
    GDALAllRegister();
    GDALDataset* memory = GetGDALDriverManager()->GetDriverByName("MEM")->Create("", r.range_bins, 2 * r.azimuth_count,
                                                                                 1, GDT_Byte, nullptr);
    std::vector<std::uint8_t> line(static_cast<std::size_t>(r.range_bins));
    for (int i = 0; i < 2 * r.azimuth_count; ++i) {
        for (int j = 0; j < r.range_bins; ++j) {
            const std::size_t cell = r.index(i % r.azimuth_count, j);
            const double level = 255 * (10 * std::log10((watts[cell] + noise) / noise)) / 50;
            const std::uint8_t shades[] = {90, 0, 255, 190, 40};
            line[static_cast<std::size_t>(j)] =
                i < r.azimuth_count ? static_cast<std::uint8_t>(std::clamp(level, 0.0, 255.0)) : shades[r.state[cell]];
        }
        CHECK(memory->GetRasterBand(1)->RasterIO(GF_Write, 0, i, r.range_bins, 1, line.data(), r.range_bins, 1,
                                                 GDT_Byte, 0, 0, nullptr) == CE_None);
    }
    const std::string path = std::string(folder) + "/" + name + ".png";
    GDALClose(
        GetGDALDriverManager()->GetDriverByName("PNG")->CreateCopy(path.c_str(), memory, 0, nullptr, nullptr, nullptr));
    GDALClose(memory);
}

}  // namespace

TEST_CASE("convergence on real scenes", "[.][study]") {
    struct Sampling {
        int rays;
        double step;
        bool split;
    };
    // The first is the truth the others are measured against.
    const Sampling samplings[] = {{96, 0.0625, true}, {48, 0.125, true}, {32, 0.125, true},  {24, 0.125, true},
                                  {24, 0.25, true},   {12, 0.25, true},  {48, 0.125, false}, {48, 0.03125, false}};
    const double noise = noise_w(1.2 / 0.5e-6, 8);
    for (Named& n : real_scenes()) {
        Result truth;
        for (const Sampling& sampling : samplings) {
            n.scene.rays_per_bin = sampling.rays;
            n.scene.step_posts = sampling.step;
            n.scene.split_steps = sampling.split;
            Result r = simulate(n.scene);
            if (truth.power_w.empty()) {
                truth = r;
                write_png(n.name, r, r.power_w, noise);
                write_png(n.name + "_echo", r, r.echo_w, noise / 100);
                std::size_t counts[5] = {};
                for (const auto state : r.state) ++counts[state];
                std::printf(
                    "%s: reference height %.1f m, post %.2f m, position error %.1e posts; no data %zu shadow %zu seen "
                    "%zu unknown %zu outside %zu\n",
                    n.name.c_str(), r.reference_height_m, r.post_m, r.position_error_posts, counts[0], counts[1],
                    counts[2], counts[3], counts[4]);
            }
            const Comparison c = compare(r.power_w, truth.power_w, noise);
            std::printf(
                "  rays %3d step 1/%-4g %-7s cpu %6.1f s  rms %.4f p99 %.4f median %+.5f max %.2f dB of %zu  states "
                "%.3f %%\n",
                sampling.rays, 1 / sampling.step, sampling.split ? "split" : "uniform", r.cpu_s, c.rms_db, c.p99_db,
                c.median_db, c.max_db, c.count, 100 * state_difference(r.state, truth.state));
            std::fflush(stdout);
        }
    }
}
