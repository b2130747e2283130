// Opening and checking rasters, and counting what they hold.
#include <catch2/catch.hpp>

#include <cpl_conv.h>
#include <cpl_vsi.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <map>

#include "lib/error.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/refusal.hpp"
#include "tiles/code_counts.hpp"
#include "tiles/file_stamp.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/raster.hpp"
#include "tiles/raster_file.hpp"
#include "tiles/sources.hpp"

using namespace wedgescope;
using Catch::Matchers::Contains;
using wedgescope::test::draw;
using wedgescope::test::Drawing;
using wedgescope::test::Folder;

namespace {

const std::string data = WEDGESCOPE_TEST_DATA;
const GdalSession session(std::size_t{16} << 20, {});

float post(const std::string& dem, std::int64_t column, std::int64_t row) {
    DataBaseParams params;
    params.dem = dem;
    return open_direct_source(params)->bare_terrain_m(column, row);
}

/// What is thrown for a raster that is read whole.
template <class Kind>
std::string refusal(const std::string& dem) {
    return test::refusal<Kind>([&] {
        DataBaseParams params;
        params.dem = dem;
        const auto source = open_direct_source(params);
        const DataBase& d = source->data_base();
        source->load({{0, d.columns}, {0, d.rows}}, false);
    });
}

}  // namespace

TEST_CASE("a gzipped raster is the same file after it was read through for the first time", "[raster]") {
    const Folder folder;
    Drawing d;
    d.columns = d.rows = 300;
    d.type = GDT_Int16;
    d.value = [](int c, int r) { return c + r; };
    draw(folder / "plain.tif", d);
    const std::string packed = "/vsigzip/" + (folder / "packed.tif.gz");
    {
        std::ifstream in(folder / "plain.tif", std::ios::binary);
        const std::string bytes(std::istreambuf_iterator<char>(in), {});
        VSILFILE* out = VSIFOpenL(packed.c_str(), "wb");
        REQUIRE(out);
        CHECK(VSIFWriteL(bytes.data(), 1, bytes.size(), out) == bytes.size());
        VSIFCloseL(out);
    }
    CPLSetConfigOption("CPL_VSIL_GZIP_WRITE_PROPERTIES", "YES");  // as it is of all but small files
    const std::uint64_t before = raster_fingerprint({}, {packed});
    CHECK(post(packed, 200, 100) == 300);
    CHECK(raster_fingerprint({}, {packed}) == before);
    CPLSetConfigOption("CPL_VSIL_GZIP_WRITE_PROPERTIES", nullptr);
}

TEST_CASE("real rasters hold what their producers say", "[raster]") {
    // Ranges and shares: tests/data/README.md, counted with gdalinfo.
    const RasterSummary inland = summarise_raster(data + "/inland_empire_dem.tif", false);
    CHECK(inland.columns == 1600);
    CHECK(inland.rows == 1600);
    CHECK(inland.lowest == 50);
    CHECK(inland.highest == 1734);
    CHECK(inland.void_posts == 0);
    CHECK(inland.crs_name == "WGS 84 / UTM zone 11N (EPSG:32611)");
    CHECK(inland.compression == "DEFLATE");
    CHECK(inland.block_columns == 256);
    CHECK_FALSE(inland.geographic);
    CHECK(inland.west == Approx(-117.7612).margin(1e-4));
    CHECK(inland.east == Approx(-117.2401).margin(1e-4));
    CHECK(inland.south == Approx(33.5822).margin(1e-4));
    CHECK(inland.north == Approx(34.0172).margin(1e-4));

    const RasterSummary coast = summarise_raster(data + "/olympic_coast_dem.tif", false);
    CHECK(coast.geographic);
    CHECK(coast.lowest == -13);
    CHECK(coast.highest == 1095);
    CHECK(static_cast<double>(coast.void_posts) / (1801.0 * 3601) == Approx(0.0003).margin(0.00005));

    const RasterSummary lake = summarise_raster(data + "/lake_sunapee_dem.tif", false);
    CHECK(lake.lowest == Approx(290.7).margin(0.05));
    CHECK(lake.highest == Approx(714.8).margin(0.05));

    const RasterSummary mountains = summarise_raster(data + "/N44W072.hgt", false);
    CHECK(mountains.driver == "SRTMHGT");
    CHECK(mountains.lowest == 115);
    CHECK(mountains.highest == 1908);

    const RasterSummary culture = summarise_raster(data + "/inland_empire_culture.tif", true);
    const double cells = 1600.0 * 1600;
    CHECK(static_cast<double>(culture.codes.counts().at(91)) / cells == Approx(0.309).margin(0.0005));
    CHECK(static_cast<double>(culture.codes.counts().at(98)) / cells == Approx(0.012).margin(0.0005));
    CHECK(culture.codes.counts().count(92) == 0);

    const RasterSummary nlcd = summarise_raster(data + "/lake_sunapee_culture.tif", true);
    CHECK(static_cast<double>(nlcd.void_posts) / (467.0 * 262) == Approx(0.12).margin(0.005));
    CHECK(nlcd.codes.counts().count(0) == 0);
    std::uint64_t sum = nlcd.void_posts;
    for (const auto& [code, n] : nlcd.codes.counts()) sum += n;
    CHECK(sum == 467u * 262u);
}

TEST_CASE("scale, offset and feet are honoured", "[raster]") {
    const Folder folder;
    Drawing d;
    d.type = GDT_Int16;
    d.value = [](int c, int r) { return 100 * c + r; };
    draw(folder / "plain.tif", d);
    CHECK(post(folder / "plain.tif", 2, 1) == 201);
    d.scale = 0.5;
    d.offset = -20;
    draw(folder / "scaled.tif", d);
    CHECK(post(folder / "scaled.tif", 2, 1) == 80.5F);
    for (const char* unit : {"ft", "foot", "feet", "Feet"}) {
        d.unit = unit;
        draw(folder / "feet.tif", d);
        CHECK(post(folder / "feet.tif", 2, 1) == static_cast<float>(80.5 * 0.3048));
    }
    for (const char* unit : {"US survey foot", "us-ft", "ftUS"}) {
        d.unit = unit;
        draw(folder / "survey.tif", d);
        CHECK(post(folder / "survey.tif", 2, 1) == static_cast<float>(80.5 * 1200 / 3937));
    }
    for (const char* unit : {"m", "metre", "Meters above MSL"}) {
        d.unit = unit;
        draw(folder / "metres.tif", d);
        CHECK(post(folder / "metres.tif", 2, 1) == 80.5F);
    }
    const std::pair<const char*, double> parts[] = {{"km", 1000}, {"dm", 0.1}, {"[cm]", 0.01}, {"millimetres", 1e-3}};
    for (const auto& [unit, metres] : parts) {
        d.unit = unit;
        draw(folder / "parts.tif", d);
        CHECK(post(folder / "parts.tif", 2, 1) == static_cast<float>(80.5 * metres));
    }
    // What the CRS says where the band says nothing, as in the mosaics of gdalbuildvrt.
    const auto with_crs = [&](const std::string& crs, const std::string& unit) {
        const std::string path = folder / "mosaic.vrt";
        std::ofstream(path) << "<VRTDataset rasterXSize=\"4\" rasterYSize=\"3\"><SRS>" << crs
                            << "</SRS><GeoTransform>1000,10,0,2000,0,-10</GeoTransform><VRTRasterBand "
                               "dataType=\"Int16\" band=\"1\">"
                            << unit
                            << "<SimpleSource><SourceFilename relativeToVRT=\"1\">plain.tif</SourceFilename>"
                               "</SimpleSource></VRTRasterBand></VRTDataset>";
        return post(path, 2, 1);
    };
    CHECK(with_crs("EPSG:32611", "") == 201);
    CHECK(with_crs("EPSG:32611+5703", "") == 201);
    CHECK(with_crs("EPSG:32611+6360", "") == static_cast<float>(201.0 * 1200 / 3937));
    CHECK(with_crs("EPSG:32611+8228", "") == static_cast<float>(201 * 0.3048));
    CHECK(with_crs("EPSG:32611+6360", "<UnitType>m</UnitType>") == 201);
    d.unit = "yd";
    draw(folder / "yards.tif", d);
    CHECK(post(folder / "yards.tif", 2, 1) == static_cast<float>(80.5 * 0.9144));
    // Depths, which would be the ground upside down.
    for (const char* crs : {"EPSG:32611+5715", "EPSG:32611+8051"})
        CHECK_THAT(test::refusal<DataError>([&] { with_crs(crs, ""); }),
                   Contains("mosaic.vrt' holds depths") && Contains("counts downwards; accepted: heights, upwards"));
    d.unit = "dB";
    draw(folder / "power.tif", d);
    CHECK_THAT(refusal<DataError>(folder / "power.tif"),
               Contains("power.tif' has heights in the unit 'dB'; accepted: m, ft"));
    CHECK_FALSE(summarise_raster(folder / "power.tif", false).unit_m.has_value());
    // Culture heights too; of codes no unit counts.
    draw(folder / "canopy.tif", d);
    CHECK_THAT(test::refusal<DataError>([&] { RasterFile("culture-height", folder / "canopy.tif"); }),
               Contains("culture-height '") && Contains("in the unit 'dB'"));
    CHECK_NOTHROW(RasterFile("culture", folder / "power.tif"));
}

TEST_CASE("no-data, NaN and masks are voids", "[raster]") {
    const Folder folder;
    const auto hole = [](int c, int r) { return c == 1 && r == 2; };
    const auto check = [&](const Drawing& d) {
        draw(folder / "void.tif", d);
        CHECK(std::isnan(post(folder / "void.tif", 1, 2)));
        CHECK(post(folder / "void.tif", 2, 2) == 7);
        CHECK(summarise_raster(folder / "void.tif", false).void_posts == 1);
    };
    Drawing d;
    for (double none : {-32768.0, -9999.0, 0.0}) {
        d.no_data = none;
        d.value = [=](int c, int r) { return hole(c, r) ? none : 7; };
        for (GDALDataType type : {GDT_Int16, GDT_Int32, GDT_Float32, GDT_Float64}) {
            d.type = type;
            check(d);
        }
    }
    // Written as a float's text and stored as a float: not the same number.
    for (double none : {-3.4e38, -3.40282e38, -3.4028234663852886e38, -1.7976931348623157e308, 3.4028234663852886e38,
                        1.7976931348623157e308}) {
        d.no_data = none;
        for (GDALDataType type : {GDT_Float32, GDT_Float64}) {
            d.type = type;
            const double stored = type == GDT_Float64 ? none : std::copysign(3.4028234663852886e38, none);
            d.value = [=](int c, int r) { return hole(c, r) ? stored : 7; };
            check(d);
            // Codes of either sign are none of it.
            d.value = [=](int c, int r) { return hole(c, r) ? stored : c % 2 ? 7 : -7; };
            draw(folder / "void.tif", d);
            const RasterSummary codes = summarise_raster(folder / "void.tif", true);
            CHECK(codes.void_posts == 1);
            CHECK(codes.codes.counts().count(7) == 1);
            CHECK(codes.codes.counts().count(-7) == 1);
        }
    }
    d.no_data.reset();
    d.type = GDT_Float32;
    d.value = [=](int c, int r) { return hole(c, r) ? std::numeric_limits<double>::quiet_NaN() : 7; };
    check(d);
    d.value = [](int, int) { return 7; };
    d.masked = hole;
    check(d);
    d.type = GDT_Byte;
    check(d);
}

TEST_CASE("a no-data value of 1e30, which floats round, is one", "[raster]") {
    const Folder folder;
    for (const GDALDataType type : {GDT_Float32, GDT_Float64})
        for (const double none : {1e30, -1e30}) {
            Drawing d;
            d.columns = d.rows = 8;
            d.type = type;
            d.no_data = none;
            d.value = [&](int c, int r) { return c == 3 && r == 4 ? none : 10 + c; };
            draw(folder / "dem.tif", d);
            RasterFile raster("dem", folder / "dem.tif");
            std::vector<float> heights(64);
            raster.read_heights({{0, 8}, {0, 8}}, heights.data(), 8);
            CHECK(std::isnan(heights[4 * 8 + 3]));
            CHECK(heights[4 * 8 + 4] == 14);
        }
}

TEST_CASE("a mosaic is another where a part is, by whatever name, or what lies beside one", "[raster]") {
    const Folder folder;
    Drawing d;
    d.columns = d.rows = 8;
    d.value = [](int c, int) { return c; };
    draw(folder / "part.tif", d);
    std::ofstream(folder / "part.tif.msk") << "of its own";
    const auto later = [&](const char* name) {
        const std::string path = folder / name;
        std::filesystem::last_write_time(path, std::filesystem::last_write_time(path) + std::chrono::seconds(2));
    };
    for (const std::string& part : {folder / "part.tif", "GTIFF_DIR:1:" + (folder / "part.tif")}) {
        INFO(part);
        std::ofstream(folder / "all.vrt")
            << "<VRTDataset rasterXSize='8' rasterYSize='8'><VRTRasterBand dataType='Int16' "
               "band='1'><SimpleSource><SourceFilename>"
            << part << "</SourceFilename><SourceBand>1</SourceBand></SimpleSource>"
            << "</VRTRasterBand></VRTDataset>";
        const auto print = [&] { return RasterFile("dem", folder / "all.vrt").fingerprint({}); };
        const std::uint64_t before = print();
        CHECK(print() == before);
        later("part.tif");
        const std::uint64_t changed = print();
        CHECK(changed != before);
        later("part.tif.msk");
        CHECK(print() != changed);
    }
}

TEST_CASE("what a raster is refused for goes by what it is asked for, not by who asked first", "[raster]") {
    const Folder folder;
    Drawing d;
    d.columns = d.rows = 8;
    d.unit = "fathom";
    d.value = [](int, int) { return 3; };
    draw(folder / "fathoms.tif", d);
    CHECK_NOTHROW(RasterFile("culture", folder / "fathoms.tif"));
    CHECK_THAT(test::refusal<DataError>([&] { RasterFile("culture-height", folder / "fathoms.tif"); }),
               Contains("heights in the unit 'fathom'"));
    CHECK_NOTHROW(RasterFile("culture", folder / "fathoms.tif"));
}

TEST_CASE("a height that is none is named with its post", "[raster]") {
    const Folder folder;
    Drawing d;
    d.columns = 600;
    d.rows = 500;
    d.value = [](int c, int r) { return c == 513 && r == 301 ? std::numeric_limits<double>::infinity() : 5.0; };
    draw(folder / "infinite.tif", d);
    const std::string infinite = refusal<DataError>(folder / "infinite.tif");
    CHECK_THAT(infinite, Contains("infinite.tif") && Contains("column 513") && Contains("row 301") && Contains("inf"));
    CHECK_THROWS_AS(summarise_raster(folder / "infinite.tif", false), DataError);
    d.value = [](int c, int r) { return c == 2 && r == 1 ? -100001 : 1e5; };
    draw(folder / "deep.tif", d);
    CHECK_THAT(refusal<DataError>(folder / "deep.tif"),
               Contains("column 2") && Contains("row 1") && Contains("-100001"));
    // 30000 ft is a mountain, 300000 m is not.
    d.type = GDT_Int32;
    d.unit = "ft";
    d.value = [](int, int) { return 300000; };
    draw(folder / "high.tif", d);
    CHECK(refusal<DataError>(folder / "high.tif") == test::nothing_refused);
}

TEST_CASE("what is no raster of heights is refused in one line that says why", "[raster]") {
    const Folder folder;
    CHECK_THAT(refusal<IoError>(folder / "missing.tif"), Contains("missing.tif") && Contains("No such file"));
    std::ofstream(folder / "words.tif") << "not a raster\n";
    CHECK_THAT(refusal<IoError>(folder / "words.tif"), Contains("words.tif") && Contains("not recognized"));

    Drawing d;
    d.geotransform = {{1000, 9, 3, 2000, 3, -9}};
    draw(folder / "rotated.tif", d);
    CHECK_THAT(refusal<DataError>(folder / "rotated.tif"), Contains("rotated.tif' is rotated") && Contains("gdalwarp"));
    d = {};
    d.type = GDT_CFloat32;
    draw(folder / "complex.tif", d);
    CHECK_THAT(refusal<DataError>(folder / "complex.tif"), Contains("CFloat32"));
    d = {};
    d.columns = 1;
    draw(folder / "thin.tif", d);
    CHECK_THAT(refusal<DataError>(folder / "thin.tif"), Contains("1 x 3") && Contains("at least 2 x 2"));
    d = {};
    d.geotransform = {{1000, -10, 0, 2000, 0, -10}};
    draw(folder / "mirrored.tif", d);
    CHECK_THAT(refusal<DataError>(folder / "mirrored.tif"), Contains("-10") && Contains("gdalwarp"));
    d = {};
    d.type = GDT_Byte;
    d.bands = 3;
    d.creation = {"PHOTOMETRIC=RGB"};
    draw(folder / "relief.tif", d);
    CHECK_THAT(refusal<DataError>(folder / "relief.tif"), Contains("relief.tif' is a picture, red, green and blue"));
    CHECK_NOTHROW(RasterFile("culture", folder / "relief.tif"));
    d.creation = {"PHOTOMETRIC=MINISBLACK"};
    draw(folder / "layers.tif", d);
    CHECK(refusal<DataError>(folder / "layers.tif") == test::nothing_refused);
    // An alpha that GDAL takes for no mask, and what lies below it for heights.
    for (const GDALDataType type : {GDT_Int16, GDT_Float32, GDT_UInt16}) {
        GDALDataset* const made = GetGDALDriverManager()->GetDriverByName("GTiff")->Create(
            (folder / "alpha.tif").c_str(), 4, 3, 2, type, nullptr);
        double terms[6] = {1000, 10, 0, 2000, 0, -10};
        made->SetGeoTransform(terms);
        made->GetRasterBand(1)->Fill(5);
        made->GetRasterBand(2)->SetColorInterpretation(GCI_AlphaBand);
        made->GetRasterBand(2)->Fill(0);
        GDALClose(made);
        if (type == GDT_UInt16) {
            CHECK(std::isnan(post(folder / "alpha.tif", 1, 1)));
            continue;
        }
        CHECK_THAT(test::refusal<DataError>([&] { RasterFile("culture", folder / "alpha.tif"); }),
                   Contains("-dstnodata"));
        CHECK_THAT(refusal<DataError>(folder / "alpha.tif"), Contains("alpha.tif' has an alpha, of type ") &&
                                                                 Contains(" in band 2 of 2, ") &&
                                                                 Contains("-dstnodata"));
    }
}

TEST_CASE("a file cut short is an error that names where, not a plain at sea level", "[raster]") {
    const Folder folder;
    // Read here, whoever told of it, and by GDAL, which names the window that was asked for.
    const std::string last = "columns 384 to 511, rows 384 to 511";
    const auto [crs, packing, where] = GENERATE_COPY(
        table<std::string, std::string, std::string>({{"EPSG:32611", "NONE", last},
                                                      {"EPSG:26911", "NONE", last},
                                                      {"EPSG:32611", "LZMA", "columns 0 to 511, rows 0 to 511"}}));
    CAPTURE(crs, packing);
    Drawing d;
    d.crs = crs;
    d.columns = d.rows = 512;
    d.type = GDT_Int16;
    d.value = [](int c, int r) { return (c * 7919 + r * 104729) % 8009; };  // hardly shrinks
    d.creation = {"TILED=YES", "BLOCKXSIZE=128", "BLOCKYSIZE=128", "COMPRESS=" + packing};
    const std::string path = folder / "short.tif";
    draw(path, d);
    CHECK(post(path, 511, 511) == d.value(511, 511));
    std::filesystem::resize_file(path, std::filesystem::file_size(path) - (packing == "LZMA" ? 300 : 20000));
    CHECK(post(path, 5, 5) == d.value(5, 5));
    CHECK_THAT(refusal<IoError>(path), Contains("short.tif") && Contains(where));
    CHECK_THROWS_AS(summarise_raster(path, false), IoError);
    std::filesystem::resize_file(path, 100);
    CHECK_THAT(refusal<IoError>(path), Contains("short.tif"));
}

TEST_CASE("a text cut short is an error that names where, however far down it is asked for", "[raster]") {
    const Folder folder;
    const auto write = [&](const std::string& name, int lines) {
        std::ofstream out(folder / name);
        out << "ncols 4\nnrows 400\nxllcorner 0\nyllcorner 0\ncellsize 30\n";
        for (int r = 0; r < lines; ++r) out << r << " 1 2 3\n";
    };
    write("whole.asc", 400);
    CHECK(post(folder / "whole.asc", 0, 399) == 399);
    write("cut.asc", 60);
    DataBaseParams params;
    params.dem = folder / "cut.asc";
    const auto source = open_direct_source(params);
    CHECK_THAT(test::refusal<IoError>([&] { source->bare_terrain_m(0, 380); }),
               Contains("cut.asc': row 60 cannot be read"));
    CHECK(source->bare_terrain_m(0, 40) == 40);
}

TEST_CASE("so many codes are counted, and of more the same is told in any order", "[raster]") {
    constexpr auto most = static_cast<std::int32_t>(CodeCounts::most_codes);
    CodeCounts full;
    for (std::int32_t code = 0; code < most; ++code) full.add(7 * code - 1000, 2);
    full.add(-1000, 3);  // known already
    CHECK_FALSE(full.too_many());
    CHECK(full.counts().size() == CodeCounts::most_codes);
    CHECK(full.counts().at(-1000) == 5);
    CHECK(full.cells() == 2 * CodeCounts::most_codes + 3);

    CodeCounts one_more = full;
    one_more.add(12, 1);
    CHECK(one_more.too_many());
    CHECK(one_more.counts().empty());
    CHECK(one_more.cells() == full.cells() + 1);
    CHECK(one_more.least() == -1000);
    CHECK(one_more.greatest() == 7 * (most - 1) - 1000);

    // Parts that share codes: all of them are few enough, but not together; and one that alone has too many.
    std::vector<CodeCounts> parts(6);
    for (std::int32_t code = 0; code < most; ++code)
        for (std::size_t k = 0; k < 4; ++k)
            if (code % 3 != static_cast<std::int32_t>(k)) parts[k].add(code + (k == 3 ? most / 2 : 0), k + 1);
    for (std::int32_t code = 0; code <= most; ++code) parts[4].add(-code, 1);
    parts[5].add(3, 1);
    CHECK(parts[4].too_many());
    std::vector<std::size_t> order = {0, 1, 2, 3, 4, 5};
    const auto sum_of = [&](std::size_t count) {
        CodeCounts sum;
        for (std::size_t i = 0; i < count; ++i) sum.add(parts[order[i]]);
        return sum;
    };
    const CodeCounts few = sum_of(3), all = sum_of(6);
    CHECK_FALSE(few.too_many());
    CHECK(few.counts().at(4) == 1 + 3);
    CHECK(all == CodeCounts::of_too_many(all.cells(), -most, most - 1 + most / 2));
    std::uint64_t cells = 0;
    for (const CodeCounts& part : parts) cells += part.cells();
    CHECK(all.cells() == cells);
    int orders = 0, unlike = 0;
    while (std::next_permutation(order.begin(), order.end()))
        if (++orders % 36 == 0) unlike += !(sum_of(6) == all);
    CHECK(orders == 719);
    CHECK(unlike == 0);
    // Threads add to parts of their own, which are added in their turn.
    CodeCounts left = sum_of(3), right;
    for (std::size_t i = 3; i < 6; ++i) right.add(parts[order[i]]);
    right.add(left);
    CHECK(right == all);
}

TEST_CASE("codes are whole numbers", "[raster]") {
    const Folder folder;
    Drawing d;
    d.value = [](int c, int) { return c; };
    draw(folder / "codes.tif", d);
    const RasterSummary summary = summarise_raster(folder / "codes.tif", true);
    CHECK(summary.codes.counts() == std::map<int, std::uint64_t>{{0, 3}, {1, 3}, {2, 3}, {3, 3}});
    d.value = [](int c, int r) { return c == 2 && r == 1 ? 1.5 : 1; };
    draw(folder / "parts.tif", d);
    CHECK_THROWS_WITH(summarise_raster(folder / "parts.tif", true),
                      Contains("column 2") && Contains("row 1") && Contains("1.5"));
}
