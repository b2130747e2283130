// Echo, power, states and scope as files: metadata, georeference, geolocation.
#include <catch2/catch.hpp>

#include <gdal_alg.h>
#include <zlib.h>

#include <GeographicLib/Geodesic.hpp>
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <numbers>
#include <thread>

#include "lib/error.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/refusal.hpp"
#include "tests/small_disk.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/ground_places.hpp"
#include "tiles/output_check.hpp"
#include "tiles/picture.hpp"
#include "tiles/png_file.hpp"
#include "tiles/polar_raster.hpp"
#include "tiles/power_stack.hpp"

using namespace wedgescope;
using Catch::Matchers::Contains;
using wedgescope::test::Folder;
using wedgescope::test::SmallDisk;

namespace {

const GdalSession session(std::size_t{16} << 20, {});
constexpr double lat = 44.27, lon = -71.30, sensor_m = 3000, reference_m = 500;

RunResult drawn_run(std::int64_t circle, Interval azimuths, Interval ranges, double range_bin_m) {
    RunResult run;
    ResolvedScene& s = run.scene;
    s.geometry = Geometry::geodesic;
    s.has_lat_lon = true;
    s.lat_deg = lat;
    s.lon_deg = lon;
    s.x = lon;
    s.y = lat;
    s.sensor_m = sensor_m;
    s.reference_m = reference_m;
    s.earth = Earth(4.0 / 3 * mean_radius_m);
    s.shown = {circle, range_bin_m, azimuths, ranges};
    s.swept = s.shown;
    run.power_w = PolarImage<float>(s.shown);
    run.state = PolarImage<std::uint8_t>(s.shown);
    for (std::size_t i = 0; i < run.power_w.cells.size(); ++i) {
        run.power_w.cells[i] = i % 7 == 0 ? 0.0F : 1e-12F * static_cast<float>(i);
        run.state.cells[i] = static_cast<std::uint8_t>(i % 5);
    }
    run.echo_w = run.power_w;
    run.echo_state = run.state;
    return run;
}

struct Read {
    GDALDataset* dataset;
    explicit Read(const std::string& path) : dataset(GDALDataset::Open(path.c_str())) { REQUIRE(dataset); }
    ~Read() { GDALClose(dataset); }
    std::string item(const char* key, const char* domain = nullptr) const {
        const char* value = dataset->GetMetadataItem(key, domain);
        return value ? value : "(none)";
    }
    std::vector<double> band(int b) const {
        const int w = dataset->GetRasterXSize(), h = dataset->GetRasterYSize();
        std::vector<double> values(static_cast<std::size_t>(w) * static_cast<std::size_t>(h));
        REQUIRE(dataset->GetRasterBand(b)->RasterIO(GF_Read, 0, 0, w, h, values.data(), w, h, GDT_Float64, 0, 0,
                                                    nullptr) == CE_None);
        return values;
    }
};

/// What gdalwarp -geoloc places with: raster column, row <-> x, y of `target`.
class Warper {
public:
    Warper(GDALDataset* dataset, const char* target) {
        CPLStringList options;
        options.SetNameValue("SRC_METHOD", "GEOLOC_ARRAY");
        options.SetNameValue("DST_SRS", target);
        arg_ = GDALCreateGenImgProjTransformer2(dataset, nullptr, options.List());
        REQUIRE(arg_);
    }
    ~Warper() { GDALDestroyGenImgProjTransformer(arg_); }
    Warper(const Warper&) = delete;
    Warper& operator=(const Warper&) = delete;
    bool to_ground(double& x, double& y) const { return go(false, x, y); }
    bool to_raster(double& x, double& y) const { return go(true, x, y); }

private:
    bool go(bool back, double& x, double& y) const {
        double z = 0;
        int good = 0;
        GDALGenImgProjTransform(arg_, back, 1, &x, &y, &z, &good);
        return good != 0;
    }
    void* arg_;
};

std::string bytes(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

template <class Write>
std::string write(const Folder& folder, const std::string& name, Write&& body) {
    OutputFile file(folder / name, true);
    body(file);
    file.commit();
    return folder / name;
}

RasterFormat plain_format() {
    RasterFormat format;
    format.version = "1.2.3";
    format.scene_json = R"({"range_m": 25000.5, "name": "a < b & \"c\""})";
    return format;
}

}  // namespace

TEST_CASE("a polar raster tells where its cells are, in what unit, and of what scene", "[polar_raster]") {
    const Folder folder;
    const RunResult run = drawn_run(960, {950, 1000}, {40, 300}, 18.737028625);
    const RasterFormat format = plain_format();
    const std::string echo = write(folder, "echo.tif", [&](OutputFile& f) { write_echo(run, f, format); });
    const std::string power =
        write(folder, "power.tif", [&](OutputFile& f) { write_power(run, PowerUnit::dbm, f, format); });
    const std::string states = write(folder, "states.tif", [&](OutputFile& f) { write_states(run, f, format); });
    {
        const Read in(echo);
        CHECK(in.dataset->GetRasterXSize() == 260);
        CHECK(in.dataset->GetRasterYSize() == 50);
        CHECK(in.item("AZIMUTH_START_DEG") == "356.25");  // 950 * 0.375
        CHECK(in.item("AZIMUTH_STEP_DEG") == "0.375");
        CHECK(in.item("RANGE_START_M") == "749.481145");
        CHECK(in.item("RANGE_STEP_M") == "18.737028625");
        CHECK(in.item("REFERENCE_HEIGHT_M") == "500");
        CHECK(in.item("SENSOR_LAT") == "44.27");
        CHECK(in.item("SENSOR_LON") == "-71.3");
        CHECK(in.item("SENSOR_HEIGHT_M") == "3000");
        CHECK(in.item("SCENE_JSON") == format.scene_json);
        CHECK(in.item("SOFTWARE") == "wedgescope 1.2.3");
        CHECK(std::string(in.dataset->GetRasterBand(1)->GetUnitType()) == "W");
        CHECK(in.dataset->GetRasterBand(1)->GetRasterDataType() == GDT_Float32);
        const auto echo_values = in.band(1), state_values = in.band(2);
        CHECK(std::equal(echo_values.begin(), echo_values.end(), run.echo_w.cells.begin(), run.echo_w.cells.end(),
                         [](double a, float b) { return static_cast<float>(a) == b; }));
        CHECK(std::equal(state_values.begin(), state_values.end(), run.state.cells.begin(), run.state.cells.end()));
    }
    {
        const Read in(power);
        GDALRasterBand& band = *in.dataset->GetRasterBand(1);
        CHECK(std::string(band.GetUnitType()) == "dBm");
        int has = 0;
        CHECK(band.GetNoDataValue(&has) == -9999);
        CHECK(has);
        const auto values = in.band(1);
        CHECK(values[0] == -9999);
        CHECK(values[1] == Approx(-90).margin(0.0006));  // 1e-12 W
        CHECK(values[10] == Approx(-80).margin(0.0006));
    }
    {
        const Read in(states);
        double none[6];
        (void)in.dataset->GetGeoTransform(none);  // GDAL 3.6 looks into the .aux.xml of a GeoTIFF only after this
        GDALRasterBand& band = *in.dataset->GetRasterBand(1);
        CHECK(band.GetRasterDataType() == GDT_Byte);
        REQUIRE(band.GetCategoryNames());
        const CPLStringList names(CSLDuplicate(band.GetCategoryNames()));
        REQUIRE(names.Count() == 5);
        CHECK(std::string(names[0]) == "no data");
        CHECK(std::string(names[4]) == "outside");
        int has = 1;
        band.GetNoDataValue(&has);
        CHECK_FALSE(has);
    }
}

TEST_CASE("numbers of the metadata have fifteen digits, and nothing is minus zero", "[polar_raster]") {
    CHECK(fifteen_digits(-0.0) == "0");
    CHECK(fifteen_digits(0) == "0");
    CHECK(fifteen_digits(-1.5) == "-1.5");
    CHECK(fifteen_digits(44.968868699999994) == "44.9688687");
}

TEST_CASE("gdalwarp -geoloc finds every cell of a polar raster where the geodesic puts it", "[polar_raster]") {
    const Folder folder;
    const double bin = 30;
    for (const Interval azimuths : {Interval{0, 480}, Interval{400, 520}}) {
        const RunResult run = drawn_run(480, azimuths, {0, 800}, bin);
        const std::string path =
            write(folder, "states.tif", [&](OutputFile& f) { write_states(run, f, plain_format()); });
        const Read in(path);
        CHECK(in.item("X_DATASET", "GEOLOCATION") == "states.tif.geoloc.tif");
        const Warper warper(in.dataset, "EPSG:4326");
        const Earth& earth = run.scene.earth;
        int lost = 0, tried = 0;
        double worst_ground_m = 0, worst_column = 0, worst_row = 0;
        for (std::int64_t row = 0; row < azimuths.size(); row += 3)
            for (int column = 120; column < 800; column += 17) {
                const double azimuth = (static_cast<double>(azimuths.begin + row) + 0.5) * 0.75,
                             range = (column + 0.5) * bin;
                const double arc = earth.arc_m(sensor_m, reference_m, range).value();
                double y = 0, x = 0;
                GeographicLib::Geodesic::WGS84().Direct(lat, lon, azimuth, arc, y, x);
                // The other way: from the cell's centre to the ground.
                double gx = column + 0.5, gy = static_cast<double>(row) + 0.5, distance = 0;
                REQUIRE(warper.to_ground(gx, gy));
                GeographicLib::Geodesic::WGS84().Inverse(y, x, gy, gx, distance);
                worst_ground_m = std::max(worst_ground_m, distance);
                // Due north GDAL interpolates row numbers across the seam of the full circle and finds no place.
                const double off_north = std::abs(std::remainder(azimuth, 360.0)) * std::numbers::pi / 180 * arc;
                if (azimuths.size() == 480 && std::abs(std::remainder(azimuth, 360.0)) < 90 && off_north < 500)
                    continue;
                ++tried;
                if (!warper.to_raster(x, y)) {
                    ++lost;
                    continue;
                }
                worst_column = std::max(worst_column, std::abs(x - (column + 0.5)));
                worst_row = std::max(worst_row, std::abs(y - (static_cast<double>(row) + 0.5)));
            }
        INFO(azimuths.size() << " bins: ground " << worst_ground_m << " m, column " << worst_column << ", row "
                             << worst_row << ", lost " << lost << " of " << tried);
        CHECK(worst_ground_m < bin);  // a range cell
        CHECK(worst_column < 1);
        CHECK(worst_row < 1);
        CHECK(lost * 100 <= tried);
        CHECK(tried > 1000);
    }
}

TEST_CASE("gdalwarp -geoloc finds the cells across the antimeridian, beyond 180 degrees and near a pole",
          "[polar_raster]") {
    const Folder folder;
    struct Where {
        double lat_deg, lon_deg;
        const char* target;
    };
    for (const Where& where :
         {Where{-17, 179.99, "EPSG:32760"}, Where{-17, -179.99, "EPSG:32701"}, Where{66, 179.99, "EPSG:32660"},
          Where{10, 359.5, "EPSG:4326"}, Where{10, 359.5, "EPSG:32630"}, Where{81, 90, "EPSG:3413"},
          Where{85.47, 180, "EPSG:3413"}, Where{-89.7, 90, "EPSG:3031"}, Where{89.99, 10, "EPSG:3413"},
          Where{44, 12, "EPSG:32633"}}) {
        INFO(where.lat_deg << ", " << where.lon_deg << " onto " << where.target);
        const double bin = 25;
        RunResult run = drawn_run(480, {0, 480}, {0, 260}, bin);
        run.scene.lat_deg = where.lat_deg;
        run.scene.lon_deg = where.lon_deg;
        const std::string path =
            write(folder, "states.tif", [&](OutputFile& f) { write_states(run, f, plain_format()); });
        const Read in(path);
        // Where degrees do, they stay: who looks at the numbers knows them.
        CHECK((in.item("SRS", "GEOLOCATION").find("PROJCS") != std::string::npos) == (where.lat_deg != 44));
        const Warper warper(in.dataset, where.target);
        OGRSpatialReference degrees, target;
        degrees.importFromEPSG(4326);
        target.SetFromUserInput(where.target);
        for (OGRSpatialReference* crs : {&degrees, &target}) crs->SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
        const bool same = target.IsGeographic();
        const std::unique_ptr<OGRCoordinateTransformation> there(OGRCreateCoordinateTransformation(&degrees, &target));
        int lost = 0, tried = 0;
        double worst_cells = 0;
        for (int row = 0; row < 480; row += 7)
            for (int column = 110; column < 250; column += 11) {
                const double azimuth = (row + 0.5) * 0.75, range = (column + 0.5) * bin;
                const double arc = run.scene.earth.arc_m(sensor_m, reference_m, range).value();
                const double north = std::remainder(azimuth, 360.0) * std::numbers::pi / 180;
                if (std::abs(north) < 1.5 && std::abs(north) * arc < 500) continue;  // GDAL does not close the circle
                double y = 0, x = 0;
                GeographicLib::Geodesic::WGS84().Direct(where.lat_deg, where.lon_deg, azimuth, arc, y, x);
                if (same) x = where.lon_deg + std::remainder(x - where.lon_deg, 360.0);
                if (!same) REQUIRE(there->Transform(1, &x, &y));
                ++tried;
                if (!warper.to_raster(x, y)) {
                    ++lost;
                    continue;
                }
                worst_cells = std::max({worst_cells, std::abs(x - (column + 0.5)), std::abs(y - (row + 0.5))});
            }
        CHECK(tried > 700);
        CHECK(lost * 100 <= tried);
        CHECK(worst_cells < 1);
    }
}

TEST_CASE("in grid geometry cells lie in the raster's own x and y", "[polar_raster]") {
    const Folder folder;
    RunResult run = drawn_run(360, {90, 180}, {0, 500}, 20);
    ResolvedScene& s = run.scene;
    s.geometry = Geometry::grid;
    s.earth = Earth();
    s.sensor_m = s.reference_m = 0;  // range = arc
    s.x = 500000;
    s.y = 4000000;
    RasterFormat format = plain_format();
    for (const bool has_crs : {true, false}) {
        if (has_crs) {
            OGRSpatialReference utm;
            utm.importFromEPSG(32611);
            char* wkt = nullptr;
            utm.exportToWkt(&wkt);
            format.crs_wkt = wkt;
            CPLFree(wkt);
        } else {
            format.crs_wkt.clear();
        }
        const std::string path =
            write(folder, "power.tif", [&](OutputFile& f) { write_power(run, PowerUnit::watt, f, format); });
        const Read in(path);
        CHECK_THAT(in.item("SRS", "GEOLOCATION"), Contains(has_crs ? "32611" : "LOCAL_CS"));
        const Warper warper(in.dataset, has_crs ? "EPSG:32611" : nullptr);
        // Azimuth bin 135.5 degrees, range 200.5 bins = 4010 m: south-east.
        double x = 200.5, y = 45.5;
        REQUIRE(warper.to_ground(x, y));
        CHECK(x == Approx(500000 + 4010 * std::sin(135.5 * std::numbers::pi / 180)).margin(5));
        CHECK(y == Approx(4000000 + 4010 * std::cos(135.5 * std::numbers::pi / 180)).margin(5));
        REQUIRE(warper.to_raster(x, y));
        CHECK(x == Approx(200.5).margin(0.5));
        CHECK(y == Approx(45.5).margin(0.5));
    }
}

TEST_CASE("the same run gives the same bytes, without a word of where it was written", "[polar_raster]") {
    const Folder here, there;
    const RunResult run = drawn_run(360, {0, 360}, {0, 100}, 100);
    const RasterFormat format = plain_format();
    for (const char* name : {"states.tif", "power.tif"}) {
        const auto body = [&](OutputFile& f) {
            if (name[0] == 's')
                write_states(run, f, format);
            else
                write_power(run, PowerUnit::watt, f, format);
        };
        const std::string a = write(here, name, body), b = write(there, name, body);
        CHECK(bytes(a) == bytes(b));
        CHECK(bytes(a + ".geoloc.tif") == bytes(b + ".geoloc.tif"));
        CHECK(bytes(a).find(here / "") == std::string::npos);
        CHECK(bytes(a).find(".tmp-") == std::string::npos);
    }
    CHECK(here.names() == std::vector<std::string>{"power.tif", "power.tif.geoloc.tif", "states.tif",
                                                   "states.tif.aux.xml", "states.tif.geoloc.tif"});
    CHECK(bytes(here / "states.tif.aux.xml") == bytes(there / "states.tif.aux.xml"));
}

TEST_CASE("rasters written side by side in little cache are what each is alone", "[polar_raster]") {
    const Folder folder;
    const RunResult run = drawn_run(240, {0, 240}, {0, 270}, 100);
    const auto power = [&](const std::string& name) {
        return write(folder, name, [&](OutputFile& f) { write_power(run, PowerUnit::watt, f, plain_format()); });
    };
    const GIntBig before = GDALGetCacheMax64();
    GDALSetCacheMax64(1 << 21);  // a few blocks
    std::atomic<int> failed = 0;
    std::vector<std::thread> writers;
    constexpr int threads = 3, files = 40;
    const auto name = [](int t, int i) { return std::to_string(t) + "_" + std::to_string(100 + i) + ".tif"; };
    for (int t = 0; t < threads; ++t)
        writers.emplace_back([&, t] {
            try {
                for (int i = 0; i < files; ++i) power(name(t, i));
            } catch (const std::exception&) {
                ++failed;
            }
        });
    for (std::thread& writer : writers) writer.join();
    GDALSetCacheMax64(before);
    REQUIRE(failed == 0);
    const std::string alone = bytes(power(name(0, 0))), places = bytes(folder / (name(0, 0) + ".geoloc.tif"));
    int others = 0;
    for (int t = 1; t < threads; ++t)
        for (int i = 0; i < files; ++i) {
            const std::string path = folder / name(t, i);
            others += bytes(path + ".geoloc.tif") == places ? 0 : 1;
            others += bytes(path).size() == alone.size() ? 0 : 1;  // it names its geolocation
        }
    CHECK(others == 0);
}

TEST_CASE("drivers and creation options are the user's choice, and bad ones are named", "[polar_raster]") {
    const Folder folder;
    const RunResult run = drawn_run(36, {0, 36}, {0, 50}, 100);
    const auto power = [&](const std::string& name, const RasterFormat& format) {
        return write(folder, name, [&](OutputFile& f) { write_power(run, PowerUnit::watt, f, format); });
    };
    RasterFormat format = plain_format();
    format.creation = {"COMPRESS=ZSTD", "TILED=NO"};
    {
        const Read in(power("zstd.tif", format));
        CHECK(in.item("COMPRESSION", "IMAGE_STRUCTURE") == "ZSTD");
    }
    format.creation = {"COMPRESS"};
    CHECK_THROWS_WITH(power("bad.tif", format), Contains("co 'COMPRESS'") && Contains("NAME=VALUE"));
    format.creation = {"COMPRES=LZW"};
    CHECK_THROWS_WITH(power("bad.tif", format), Contains("COMPRES"));
    CHECK_THROWS_AS(power("bad.tif", format), InputError);
    format.creation.clear();
    CHECK_THROWS_WITH(power("power.foo", format), Contains("power.foo") && Contains(".tif") && Contains("--of"));
    CHECK_THROWS_WITH(power("power.png", format), Contains("Float32") && Contains("takes Byte, UInt16;"));
    format.driver = "NONE";
    CHECK_THROWS_WITH(power("power.tif", format), Contains("of 'NONE'"));
    format.driver = "ENVI";
    const Read in(power("power.bin", format));
    CHECK(std::string(in.dataset->GetDriver()->GetDescription()) == "ENVI");
    CHECK(in.band(1)[5] == Approx(5e-12));
}

TEST_CASE("a raster that does not fit on the disk is an error, and nothing is left", "[polar_raster]") {
    const Folder folder;
    RunResult run = drawn_run(720, {0, 720}, {0, 1000}, 30);
    std::uint32_t noise = 1;
    for (float& cell : run.power_w.cells) cell = static_cast<float>((noise = noise * 1664525u + 1013904223u) >> 8);
    for (const rlim_t most : {rlim_t{100000}, rlim_t{1000000}, rlim_t{1900000}}) {
        const std::string message = [&] {
            const SmallDisk disk(most);
            return test::refusal<IoError>(
                [&] { write(folder, "power.tif", [&](OutputFile& f) { write_power(run, PowerUnit::watt, f, {}); }); });
        }();
        CHECK_THAT(message, Contains("power.tif' cannot be written"));
        CHECK(folder.names().empty());
    }
}

namespace {

RunResult drawn_scope(DisplayKind kind, bool rings, double up_rad) {
    RunResult run = drawn_run(360, {0, 360}, {0, 800}, 30);
    run.scene.scene.display.kind = kind;
    run.scene.scene.display.rings = rings;
    Picture& p = run.scope;
    p.frame = {200, 150, 100, 75, 100, up_rad};
    p.grey.resize(200 * 150);
    for (std::size_t i = 0; i < p.grey.size(); ++i) p.grey[i] = static_cast<std::uint8_t>(i * 7);
    return run;
}

}  // namespace

namespace {

/// An image of a band: no two are alike in any cell.
std::vector<float> band_image(const StackContent& content, std::size_t band) {
    std::vector<float> cells(static_cast<std::size_t>(content.columns * content.rows));
    for (std::size_t i = 0; i < cells.size(); ++i) cells[i] = 1e-12F * static_cast<float>(i * content.bands + band);
    return cells;
}

/// Writes a stack with its bands in this order, in two threads.
void write_stack(const std::string& path, const StackContent& content, const std::vector<std::size_t>& order) {
    OutputFile file(path, false);
    PowerStack stack(content, file);
    const auto write = [&](std::size_t first) {
        for (std::size_t i = first; i < order.size(); i += 2) stack.write(order[i], band_image(content, order[i]));
    };
    std::thread other([&] { write(1); });
    write(0);
    other.join();
    for (std::size_t band = 0; band < content.bands; ++band)
        stack.describe("frame " + std::to_string(band + 1), {{"TIME_S", std::to_string(10 * band)}});
    stack.close();
    file.commit();
}

std::vector<float> cells_of(GDALRasterBand& band) {
    const int w = band.GetXSize(), h = band.GetYSize();
    std::vector<float> cells(static_cast<std::size_t>(w) * static_cast<std::size_t>(h), -1);
    REQUIRE(band.RasterIO(GF_Read, 0, 0, w, h, cells.data(), w, h, GDT_Float32, 0, 0, nullptr) == CE_None);
    return cells;
}

std::string bytes_of(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace

TEST_CASE("a stack's bands are written in any order, in TIFFs of either width, and every cell comes back",
          "[polar_raster][threads]") {
    const Folder folder;
    StackContent content;
    content.columns = 700;
    content.rows = 200;  // strips of 93 rows, and what is left
    content.bands = 5;
    content.metadata = {{"WORDS", "<a & \"b\">"}};
    std::vector<std::string> files;
    for (const bool big : {false, true}) {
        if (big) content.most_classic_bytes = 0;
        const std::string path = folder / (big ? "big.tif" : "classic.tif");
        write_stack(path, content, {4, 0, 3, 1, 2});
        write_stack(path + "f", content, {0, 1, 2, 3, 4});
        const std::string bytes = bytes_of(path);
        CHECK(bytes == bytes_of(path + "f"));
        CHECK(bytes[2] == (big ? 43 : 42));

        CPLErrorReset();
        GDALDataset* in = static_cast<GDALDataset*>(GDALOpen(path.c_str(), GA_ReadOnly));
        REQUIRE(in);
        CHECK(CPLGetLastErrorType() == CE_None);
        REQUIRE(in->GetRasterCount() == 5);
        REQUIRE(in->GetRasterXSize() == 700);
        REQUIRE(in->GetRasterYSize() == 200);
        CHECK(in->GetMetadataItem("WORDS") == std::string("<a & \"b\">"));
        CHECK(in->GetMetadataItem("INTERLEAVE", "IMAGE_STRUCTURE") == std::string("BAND"));
        for (std::size_t band = 0; band < 5; ++band) {
            GDALRasterBand& b = *in->GetRasterBand(static_cast<int>(band) + 1);
            const std::vector<float> wanted = band_image(content, band);
            CHECK(cells_of(b) == wanted);
            CHECK(b.GetDescription() == "frame " + std::to_string(band + 1));
            CHECK(b.GetMetadataItem("TIME_S") == std::to_string(10 * band));
            CHECK(b.GetUnitType() == std::string("W"));
        }
        GDALClose(in);
    }
}

TEST_CASE("a stack has as many bands as a TIFF can count", "[polar_raster]") {
    const Folder folder;
    StackContent content;
    content.columns = 3;
    content.rows = 2;
    content.bands = PowerStack::most_bands;
    const std::string path = folder / "many.tif";
    OutputFile file(path, false);
    PowerStack stack(content, file);
    for (std::size_t band = 0; band < content.bands; ++band) {
        stack.write(band, band_image(content, band));
        stack.describe(std::to_string(band), {});
    }
    stack.close();
    file.commit();
    GDALDataset* in = static_cast<GDALDataset*>(GDALOpen(path.c_str(), GA_ReadOnly));
    REQUIRE(in);
    REQUIRE(in->GetRasterCount() == 65535);
    for (const std::size_t band : {std::size_t{0}, std::size_t{40000}, content.bands - 1}) {
        GDALRasterBand& b = *in->GetRasterBand(static_cast<int>(band) + 1);
        CHECK(cells_of(b) == band_image(content, band));
        CHECK(b.GetDescription() == std::to_string(band));
    }
    GDALClose(in);
}

TEST_CASE("a stack that does not fit on the disk is refused before its first band", "[polar_raster]") {
    const Folder folder;
    StackContent content;
    content.columns = 700;
    content.rows = 200;
    content.bands = 5;
    {
        OutputFile file(folder / "s.tif", false);
        const SmallDisk disk(2000000);
        const std::string said = wedgescope::test::refusal<IoError>([&] { PowerStack(content, file); });
        CHECK_THAT(said, Contains("s.tif' cannot be written: File too large (5 frames take 3 MiB)"));
    }
    CHECK(folder.names().empty());
}

TEST_CASE("a PNG that does not fit on the disk is an error, wherever that is found, and nothing is left", "[picture]") {
    const Folder folder;
    RunResult run = drawn_scope(DisplayKind::gpi, true, 0);
    std::uint32_t noise = 1;
    for (auto& grey : run.scope.grey) grey = static_cast<std::uint8_t>((noise = noise * 1664525u + 1013904223u) >> 24);
    run.scope.state.assign(run.scope.grey.size(), 2);
    run.scene.scene.display.alpha = GENERATE(false, true);
    // At its first byte, among the pixels, and with its last ones, which the file's close writes.
    for (const rlim_t most : {rlim_t{0}, rlim_t{5000}, rlim_t{29000}}) {
        CAPTURE(most);
        const std::string message = [&] {
            const SmallDisk disk(most);
            return test::refusal<IoError>(
                [&] { write(folder, "scope.png", [&](OutputFile& f) { write_scope(run, f, {}); }); });
        }();
        CHECK_THAT(message, Contains("scope.png' cannot be written: File too large"));
        CHECK(folder.names().empty());
    }
}

TEST_CASE("a PNG of GDAL's driver, as creation options ask for, has the same pixels and the same words", "[picture]") {
    const Folder folder;
    RunResult run = drawn_scope(DisplayKind::gpi, false, 0);
    run.scope.state.assign(run.scope.grey.size(), 2);
    for (std::size_t i = 0; i < run.scope.state.size(); i += 3) run.scope.state[i] = 0;
    run.scene.scene.display.alpha = GENERATE(false, true);
    RasterFormat format;
    const Read own(write(folder, "own.png", [&](OutputFile& f) { write_scope(run, f, format); }));
    format.creation = {"ZLEVEL=6"};
    const Read theirs(write(folder, "theirs.png", [&](OutputFile& f) { write_scope(run, f, format); }));
    for (int band = 1; band <= (run.scene.scene.display.alpha ? 2 : 1); ++band)
        CHECK(own.band(band) == theirs.band(band));
    CHECK(own.band(1)[777] == static_cast<double>(run.scope.grey[777]));
    std::array<double, 6> a{}, b{};
    CHECK(own.dataset->GetGeoTransform(a.data()) == theirs.dataset->GetGeoTransform(b.data()));
    CHECK(a == b);
    for (const char* item : {"SOFTWARE", "DISPLAY", "METRES_PER_PIXEL", "SENSOR_HEIGHT_M"}) {
        REQUIRE(own.dataset->GetMetadataItem(item));
        CHECK(std::string(own.dataset->GetMetadataItem(item)) == theirs.dataset->GetMetadataItem(item));
    }
}

namespace {

/// Grey and alpha, part noise, part runs.
std::array<std::vector<std::uint8_t>, 2> some_pixels(std::size_t count) {
    std::array<std::vector<std::uint8_t>, 2> bands;
    std::uint32_t noise = 1;
    for (std::size_t i = 0; i < count; ++i) {
        noise = noise * 1664525u + 1013904223u;
        bands[0].push_back(static_cast<std::uint8_t>(i / 30000 % 2 ? noise >> 24 : i / 50));
        bands[1].push_back(noise >> 30 ? 255 : 0);
    }
    return bands;
}

/// The image data of a PNG, unpacked; nothing where that is not whole, its checksum included.
std::vector<std::uint8_t> unpacked(const std::string& png, std::size_t bytes) {
    const auto number = [&](std::size_t at) {
        std::uint32_t n = 0;
        for (std::size_t i = 0; i < 4; ++i) n = n << 8 | static_cast<std::uint8_t>(png.at(at + i));
        return n;
    };
    std::string packed;
    for (std::size_t at = 8; at + 12 <= png.size(); at += 12 + number(at))
        if (png.compare(at + 4, 4, "IDAT") == 0) packed += png.substr(at + 8, number(at));
    std::vector<std::uint8_t> rows(bytes + 1);
    uLongf length = rows.size();
    const int said = uncompress(rows.data(), &length, reinterpret_cast<const Bytef*>(packed.data()), packed.size());
    if (said != Z_OK) return {};
    rows.resize(length);
    return rows;
}

}  // namespace

TEST_CASE("a PNG is packed in pieces, the same bytes for any number of threads, and every pixel comes back",
          "[picture][threads]") {
    const Folder folder;
    // One pixel; a piece and a little more; many pieces; a row that is longer than a piece.
    const auto [columns, rows] =
        GENERATE(std::pair{1, 1}, std::pair{500, 140}, std::pair{1500, 1201}, std::pair{70001, 3});
    const bool alpha = GENERATE(false, true);
    CAPTURE(columns, rows, alpha);
    const auto pixels = static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
    const auto bands = some_pixels(pixels);
    std::vector<const std::uint8_t*> given{bands[0].data()};
    if (alpha) given.push_back(bands[1].data());
    std::string one;
    for (const int threads : {1, 2, 5}) {
        const std::string path = folder / text("scope", threads, ".png");
        write_png(path, columns, rows, given, threads, path);
        const Read in(path);
        for (std::size_t band = 0; band < given.size(); ++band) {
            const auto values = in.band(static_cast<int>(band) + 1);
            CHECK(std::equal(values.begin(), values.end(), bands[band].begin(), bands[band].end()));
        }
        std::ifstream file(path, std::ios::binary);
        const std::string bytes(std::istreambuf_iterator<char>(file), {});
        if (threads == 1) one = bytes;
        CHECK(bytes == one);
    }
    const std::size_t row = given.size() * static_cast<std::size_t>(columns) + 1;
    CHECK(unpacked(one, row * static_cast<std::size_t>(rows)).size() == row * static_cast<std::size_t>(rows));
}

TEST_CASE("a PNG that cannot be written says why, whoever writes it", "[picture][threads]") {
    const auto bands = some_pixels(std::size_t{1000} * 1000);
    const std::vector<const std::uint8_t*> given{bands[0].data()};
    // Found with the last bytes, and among the pixels.
    for (const std::int64_t rows : {3, 1000})
        for (const int threads : {1, 2})
            CHECK_THAT(test::refusal<IoError>([&] { write_png("/dev/full", 1000, rows, given, threads, "scope.png"); }),
                       Contains("output 'scope.png' cannot be written: No space left on device"));
}

TEST_CASE("a gpi scope without rings lies on the map where its pixels are", "[picture]") {
    const Folder folder;
    for (const char* name : {"scope.png", "scope.tif"})
        for (const double up : {0.0, std::numbers::pi / 6}) {
            const RunResult run = drawn_scope(DisplayKind::gpi, false, up);
            const std::string path = write(folder, name, [&](OutputFile& f) { write_scope(run, f, plain_format()); });
            const Read in(path);
            CHECK(in.item("SENSOR_LAT") == "44.27");
            const auto grey = in.band(1);
            CHECK(std::equal(grey.begin(), grey.end(), run.scope.grey.begin(), run.scope.grey.end()));
            double g[6];
            REQUIRE(in.dataset->GetGeoTransform(g) == CE_None);
            if (up == 0) {
                const double want[6] = {-10000, 100, 0, 7500, 0, -100};
                CHECK(std::equal(g, g + 6, want));
            }
            // 30 pixels right of the centre and 40 above it: 5 km away.
            const double x = g[0] + 130 * g[1] + 35 * g[2], y = g[3] + 130 * g[4] + 35 * g[5];
            const double azimuth = up + std::atan2(30, 40);
            OGRSpatialReference wgs84;
            wgs84.SetWellKnownGeogCS("WGS84");
            wgs84.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
            REQUIRE(in.dataset->GetSpatialRef());
            const std::unique_ptr<OGRCoordinateTransformation> way(
                OGRCreateCoordinateTransformation(in.dataset->GetSpatialRef(), &wgs84));
            REQUIRE(way);
            double px = x, py = y, want_lat = 0, want_lon = 0;
            REQUIRE(way->Transform(1, &px, &py));
            GeographicLib::Geodesic::WGS84().Direct(lat, lon, azimuth * 180 / std::numbers::pi, 5000, want_lat,
                                                    want_lon);
            CHECK(py == Approx(want_lat).margin(1e-8));
            CHECK(px == Approx(want_lon).margin(1e-8));
        }
    RunResult marked = drawn_scope(DisplayKind::gpi, false, 0);
    marked.scene.scene.display.azimuth_marks_rad = 0.5;
    for (const RunResult& run : {drawn_scope(DisplayKind::gpi, true, 0), marked}) {
        const Read in(write(folder, "rings.png", [&](OutputFile& f) { write_scope(run, f, {}); }));
        double g[6];
        CHECK(in.dataset->GetGeoTransform(g) != CE_None);
    }
}

TEST_CASE("off the tube's centre a scope lies on the map where its pixels are", "[picture]") {
    const Folder folder;
    RunResult run = drawn_scope(DisplayKind::gpi, false, 0);
    run.scope.frame.centre_column = 40;
    run.scope.frame.centre_row = 140;
    const Read in(write(folder, "scope.tif", [&](OutputFile& f) { write_scope(run, f, plain_format()); }));
    double g[6];
    REQUIRE(in.dataset->GetGeoTransform(g) == CE_None);
    const double want[6] = {-4000, 100, 0, 14000, 0, -100};
    CHECK(std::equal(g, g + 6, want));

    run = drawn_scope(DisplayKind::ppi, true, 0.5);
    run.scope.frame.centre_column = 40;
    run.scope.frame.centre_row = 140;
    const Read tube(write(folder, "tube.tif", [&](OutputFile& f) { write_scope(run, f, plain_format()); }));
    const Warper warper(tube.dataset, "EPSG:4326");
    double x = 40 + 60, y = 140 - 80, want_lat = 0, want_lon = 0;  // 10 km of range
    const double arc = run.scene.earth.arc_m(sensor_m, reference_m, 10000).value();
    REQUIRE(warper.to_ground(x, y));
    GeographicLib::Geodesic::WGS84().Direct(lat, lon, (0.5 + std::atan2(60, 80)) * 180 / std::numbers::pi, arc,
                                            want_lat, want_lon);
    CHECK(y == Approx(want_lat).margin(1e-7));
    CHECK(x == Approx(want_lon).margin(1e-7));
}

TEST_CASE("with alpha a scope is transparent where the data base has no data", "[picture]") {
    const Folder folder;
    RunResult run = drawn_scope(DisplayKind::gpi, false, 0);
    run.scope.state.resize(run.scope.grey.size());
    for (std::size_t i = 0; i < run.scope.state.size(); ++i)
        run.scope.state[i] = static_cast<std::uint8_t>(i / 7 % state_count);
    for (const char* name : {"scope.png", "scope.tif"}) {
        run.scene.scene.display.alpha = false;
        write(folder, name, [&](OutputFile& f) { write_scope(run, f, plain_format()); });
        CHECK(Read(folder / name).dataset->GetRasterCount() == 1);
        run.scene.scene.display.alpha = true;
        write(folder, name, [&](OutputFile& f) {
            check_output(f, OutputLayer::masked_scope, plain_format());
            write_scope(run, f, plain_format());
        });
        const Read in(folder / name);
        REQUIRE(in.dataset->GetRasterCount() == 2);
        CHECK(in.dataset->GetRasterBand(1)->GetColorInterpretation() == GCI_GrayIndex);
        CHECK(in.dataset->GetRasterBand(2)->GetColorInterpretation() == GCI_AlphaBand);
        const auto grey = in.band(1), alpha = in.band(2);
        bool same = true;
        for (std::size_t i = 0; i < grey.size(); ++i)
            same = same && grey[i] == run.scope.grey[i] && alpha[i] == (run.scope.state[i] == 0 ? 0 : 255);
        CHECK(same);
    }
    for (const char* name : {"scope.jpg", "scope.asc"})
        CHECK_THROWS_WITH(
            write(folder, name, [&](OutputFile& f) { check_output(f, OutputLayer::masked_scope, plain_format()); }),
            Contains("alpha is on") && Contains(name));
}

TEST_CASE("states are written where every code is kept, and a picture where grey is taken, or refused at once",
          "[polar_raster]") {
    const Folder folder;
    const auto check = [&](const char* name, OutputLayer layer, const std::vector<std::string>& creation = {}) {
        RasterFormat format = plain_format();
        format.creation = creation;
        const OutputFile file(folder / name, true);
        check_output(file, layer, format);
    };
    for (const char* name : {"s.tif", "s.png", "s.img", "s.bmp", "s.asc"}) {
        INFO(name);
        CHECK_NOTHROW(check(name, OutputLayer::states));
    }
    CHECK_NOTHROW(check("s.tif", OutputLayer::states, {"COMPRESS=LZW", "NBITS=4"}));
    CHECK_THROWS_WITH(check("s.jpg", OutputLayer::states),
                      Contains("s.jpg' holds codes, and driver JPEG") && Contains("does not keep them"));
    CHECK_THROWS_AS(check("s.tif", OutputLayer::states, {"COMPRESS=JPEG"}), InputError);
    CHECK_NOTHROW(check("s.jpg", OutputLayer::scope));
    if (GDALGetDriverByName("WEBP"))  // colours alone
        CHECK_THROWS_WITH(check("s.webp", OutputLayer::scope), Contains("WEBP") && Contains("takes no grey picture"));
    if (GDALGetDriverByName("JP2OpenJPEG")) {
        CHECK_THROWS_AS(check("s.jp2", OutputLayer::states), InputError);
        CHECK_NOTHROW(check("s.jp2", OutputLayer::states, {"REVERSIBLE=YES", "QUALITY=100"}));
    }
}

TEST_CASE("a ppi scope is no map and tells where its pixels are by a geolocation array", "[picture]") {
    const Folder folder;
    for (const DisplayKind kind : {DisplayKind::ppi, DisplayKind::tdppi})
        for (const char* name : {"scope.png", "scope.tif"}) {
            RunResult run = drawn_scope(kind, true, 0.5);
            run.scene.sweep_delay_m = 2500;
            const std::string path = write(folder, name, [&](OutputFile& f) { write_scope(run, f, plain_format()); });
            const Read in(path);
            double g[6];
            CHECK(in.dataset->GetGeoTransform(g) != CE_None);
            const Warper warper(in.dataset, "EPSG:4326");
            // 50 pixels right of the centre: 5 km of radius, 90 degrees to the right of up.
            double x = 150, y = 75;
            REQUIRE(warper.to_ground(x, y));
            const double range = kind == DisplayKind::ppi ? 5000 : 7500;
            double want_lat = 0, want_lon = 0;
            GeographicLib::Geodesic::WGS84().Direct(lat, lon, 0.5 * 180 / std::numbers::pi + 90,
                                                    run.scene.earth.arc_m(sensor_m, reference_m, range).value(),
                                                    want_lat, want_lon);
            CHECK(y == Approx(want_lat).margin(1e-7));
            CHECK(x == Approx(want_lon).margin(1e-7));
            REQUIRE(warper.to_raster(x, y));
            CHECK(x == Approx(150).margin(0.5));
            CHECK(y == Approx(75).margin(0.5));
        }
}

TEST_CASE("the places of a geolocation array are those of geodesics, to a hundredth of a pixel", "[picture]") {
    const Folder folder;
    for (const double here : {0.3, 44.27, -71.0, 89.95})
        for (const double metres_per_pixel : {50.0, 3000.0}) {
            INFO("latitude " << here << ", " << metres_per_pixel << " m a pixel");
            RunResult run = drawn_scope(DisplayKind::ppi, true, 0.5);
            run.scene.lat_deg = here;
            run.scene.lon_deg = 170;
            run.scope.frame.metres_per_pixel = metres_per_pixel;
            write(folder, "scope.png", [&](OutputFile& f) { write_scope(run, f, plain_format()); });
            const Read places(folder / "scope.png.geoloc.tif");
            const int columns = places.dataset->GetRasterXSize(), rows = places.dataset->GetRasterYSize();
            REQUIRE(columns == 51);
            REQUIRE(rows == 39);
            const auto x = places.band(1), y = places.band(2);
            double worst_m = 0;
            for (int j = 0; j < rows; ++j)
                for (int i = 0; i < columns; ++i) {
                    const double right = 4 * i - 100, up = 75 - 4 * j, range = std::hypot(right, up) * metres_per_pixel;
                    const double arc = range > 2500 ? run.scene.earth.arc_m(sensor_m, reference_m, range).value() : 0;
                    const auto node = static_cast<std::size_t>(j * columns + i);
                    double there_lat = 0, there_lon = 0, off_m = 0;
                    GeographicLib::Geodesic::WGS84().Direct(
                        here, 170, (0.5 + std::atan2(right, up)) * 180 / std::numbers::pi, arc, there_lat, there_lon);
                    double own_lat = y[node], own_lon = x[node];
                    if (std::abs(here) > 70)  // kilometres round the sensor
                        GeographicLib::Geodesic::WGS84().Direct(here, 170,
                                                                std::atan2(x[node], y[node]) * 180 / std::numbers::pi,
                                                                1000 * std::hypot(x[node], y[node]), own_lat, own_lon);
                    GeographicLib::Geodesic::WGS84().Inverse(there_lat, there_lon, own_lat, own_lon, off_m);
                    worst_m = std::max(worst_m, off_m);
                }
            CHECK(worst_m <= 0.01 * metres_per_pixel);
            // From afar a geodesic each would do too, but not as fast; far north and south there are no degrees.
            const Ground ground(run.scene, plain_format(), 125 * metres_per_pixel, 0.01 * metres_per_pixel);
            CHECK(ground.has_table() == (std::abs(here) < 70));
        }
}
