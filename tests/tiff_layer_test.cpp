// Rasters read without GDAL: what is known of them and their posts, beside GDAL's; and the files that are left to it.
#include <catch2/catch.hpp>

#include <gdal_priv.h>
#include <tiffio.h>

#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <functional>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "lib/error.hpp"
#include "tests/drawn_raster.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/raster_file.hpp"
#include "tiles/tiff_layer.hpp"

using namespace wedgescope;
using wedgescope::test::draw;
using wedgescope::test::Drawing;
using wedgescope::test::Folder;

namespace {

const GdalSession session(std::size_t{16} << 20, {});

bool reads_without_gdal(const std::string& path) { return PlainTiff::of("raster", path).has_value(); }

std::shared_ptr<TileCache> cache() { return std::make_shared<TileCache>(std::size_t{8} << 20); }

Drawing tiled(GDALDataType type, std::vector<std::string> creation = {}) {
    Drawing d;
    d.columns = 150;
    d.rows = 107;
    d.type = type;
    d.value = [](int c, int r) { return (c * 7 + r * 13) % 251; };
    d.creation = {"TILED=YES", "BLOCKXSIZE=64", "BLOCKYSIZE=64"};
    d.creation.insert(d.creation.end(), creation.begin(), creation.end());
    return d;
}

/// The same in strips: by default 27 rows each, 26 in the last.
Drawing striped(GDALDataType type, std::vector<std::string> creation = {}) {
    Drawing d = tiled(type);
    d.creation = std::move(creation);
    return d;
}

using Doubles = std::vector<double>;
bool same_number(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }

void check_facts(const RasterFacts& own, const RasterFacts& gdal) {
    CHECK(own.role == gdal.role);
    CHECK(own.path == gdal.path);
    CHECK(own.driver == gdal.driver);
    CHECK(own.columns == gdal.columns);
    CHECK(own.rows == gdal.rows);
    CHECK(own.block_columns == gdal.block_columns);
    CHECK(own.block_rows == gdal.block_rows);
    CHECK(own.type == gdal.type);
    CHECK(own.type_bytes == gdal.type_bytes);
    CHECK(own.signed_byte == gdal.signed_byte);
    CHECK(own.has_geotransform == gdal.has_geotransform);
    CHECK(Doubles{own.corner_x, own.corner_y, own.step_x, own.step_y} ==
          Doubles{gdal.corner_x, gdal.corner_y, gdal.step_x, gdal.step_y});
    REQUIRE(own.crs);
    REQUIRE(gdal.crs);
    CHECK(own.crs->wkt() == gdal.crs->wkt());
    CHECK(own.crs->titled() == gdal.crs->titled());
    CHECK(own.crs->mercator() == gdal.crs->mercator());
    CHECK(own.crs->in_geotiff() == gdal.crs->in_geotiff());
    CHECK(own.crs->wkt_of_old() == gdal.crs->wkt_of_old());
    CHECK(own.crs->definition() == gdal.crs->definition());
    CHECK(own.geographic == gdal.geographic);
    CHECK(own.wgs84_lat_lon == gdal.wgs84_lat_lon);
    CHECK(own.metres_per_unit == gdal.metres_per_unit);
    CHECK(Doubles{own.scale, own.offset, own.unit_m} == Doubles{gdal.scale, gdal.offset, gdal.unit_m});
    CHECK(own.unit == gdal.unit);
    CHECK(own.has_no_data == gdal.has_no_data);
    CHECK(same_number(own.no_data, gdal.no_data));
    CHECK(own.has_mask == gdal.has_mask);
    CHECK(own.compression == gdal.compression);
}

/// What is left to GDAL and what libtiff says again.
void check_told(const RasterFacts& own, const RasterFacts& gdal) {
    CHECK(own.columns == gdal.columns);
    CHECK(own.rows == gdal.rows);
    CHECK(own.block_columns == gdal.block_columns);
    CHECK(own.block_rows == gdal.block_rows);
    CHECK(own.type == gdal.type);
    CHECK(own.type_bytes == gdal.type_bytes);
    CHECK(own.compression == gdal.compression);
    CHECK((own.crs ? own.crs->wkt() : "") == (gdal.crs ? gdal.crs->wkt() : ""));
    CHECK(Doubles{own.corner_x, own.corner_y, own.step_x, own.step_y, own.scale, own.offset, own.unit_m} ==
          Doubles{gdal.corner_x, gdal.corner_y, gdal.step_x, gdal.step_y, gdal.scale, gdal.offset, gdal.unit_m});
}

void check_posts(RasterLayer& own, RasterLayer& gdal) {
    const std::int64_t columns = gdal.facts().columns, rows = gdal.facts().rows;
    const std::vector<Window> windows{{{0, columns}, {0, rows}},
                                      {{columns - 1, columns}, {rows - 1, rows}},
                                      {{0, 1}, {0, 1}},
                                      {{columns / 3, columns / 3 * 2}, {rows / 4, rows / 4 * 3}},
                                      {{columns / 2, columns}, {0, 1}},
                                      {{0, 1}, {rows / 2, rows}}};
    for (const Window& window : windows) {
        INFO(place(window));
        const auto n = static_cast<std::size_t>(window.posts());
        const std::int64_t stride = window.columns.size() + 3;  // and nothing beyond a row is touched
        const auto room = static_cast<std::size_t>(stride * window.rows.size());
        std::vector<float> a(room, -777.5F), b(room, -777.5F);
        own.read_heights(window, a.data(), stride);
        gdal.read_heights(window, b.data(), stride);
        CHECK(std::memcmp(a.data(), b.data(), room * sizeof(float)) == 0);
        if (gdal.facts().type == GDT_Float32 || gdal.facts().type == GDT_Float64) continue;
        std::vector<std::int32_t> codes(n), others(n);
        own.read_codes(window, codes.data());
        gdal.read_codes(window, others.data());
        CHECK(codes == others);
    }
}

/// libtiff as a program has it that has not called GDAL: nobody told it of GeoTIFF's tags and GDAL's.
class Untold {
public:
    Untold() : told_(TIFFSetTagExtender(nullptr)) {}
    ~Untold() { TIFFSetTagExtender(told_); }
    Untold(const Untold&) = delete;
    Untold& operator=(const Untold&) = delete;

private:
    TIFFExtendProc told_;
};

void check_alike(const std::string& path) {
    INFO(path);
    const auto own = TiffLayer::of("dem", path, cache());
    REQUIRE(own);
    RasterFile gdal("dem", path);
    check_facts(own->facts(), gdal.facts());
    check_posts(*own, gdal);
    const Untold untold;
    const auto again = PlainTiff::of("dem", path);
    REQUIRE(again);
    check_facts(again->facts, gdal.facts());
    CHECK(own->fingerprint({}) == gdal.fingerprint({}));
}

using Change = std::function<void(GDALDataset&)>;
void update(const std::string& path, const Change& change) {
    GDALDataset* file = GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_UPDATE);
    REQUIRE(file);
    change(*file);
    GDALClose(file);
}

/// To the bytes of a file.
void edit(const std::string& path, const std::function<void(std::string&)>& change) {
    std::string bytes;
    {
        std::ifstream in(path, std::ios::binary);
        bytes.assign(std::istreambuf_iterator<char>(in), {});
    }
    change(bytes);
    std::ofstream(path, std::ios::binary) << bytes;
}

/// The first of a little-endian classic TIFF, to be spoilt.
class Directory {
public:
    explicit Directory(std::string& bytes) : bytes_(bytes) {}
    void set_type(std::uint16_t tag, std::uint16_t type) { put(entry(tag) + 2, type); }
    void set_count(std::uint16_t tag, std::uint32_t count) { put(entry(tag) + 4, count); }
    void set_value(std::uint16_t tag, std::uint16_t value) { put(entry(tag) + 8, value); }

private:
    template <class T>
    T get(std::size_t at) const {
        T value;
        REQUIRE(at + sizeof value <= bytes_.size());
        std::memcpy(&value, bytes_.data() + at, sizeof value);
        return value;
    }
    template <class T>
    void put(std::size_t at, T value) {
        std::memcpy(bytes_.data() + at, &value, sizeof value);
    }
    std::size_t entry(std::uint16_t tag) const {
        const std::size_t begin = get<std::uint32_t>(4);
        for (std::size_t i = 0; i < get<std::uint16_t>(begin); ++i)
            if (get<std::uint16_t>(begin + 2 + 12 * i) == tag) return begin + 2 + 12 * i;
        FAIL("no tag " << tag);
        return 0;
    }
    std::string& bytes_;
};

}  // namespace

TEST_CASE("a plain GeoTIFF is read as GDAL reads it, whatever its type and packing", "[tiff_layer]") {
    const Folder folder;
    const std::string path = folder / "dem.tif";
    for (const GDALDataType type : {GDT_Byte, GDT_UInt16, GDT_Int16, GDT_UInt32, GDT_Int32, GDT_Float32, GDT_Float64})
        for (const std::string compression : {"NONE", "ZSTD", "DEFLATE", "LZW", "PACKBITS"})
            for (const std::string predictor : {"1", "2", "3"})
                for (const std::string order : {"LITTLE", "BIG"}) {
                    const bool predicts = compression != "NONE" && compression != "PACKBITS";
                    if ((predictor != "1" && !predicts) ||
                        (predictor == "3" && type != GDT_Float32 && type != GDT_Float64))
                        continue;
                    INFO(GDALGetDataTypeName(type) << ' ' << compression << ' ' << predictor << ' ' << order);
                    std::vector<std::string> creation{"COMPRESS=" + compression, "ENDIANNESS=" + order};
                    if (predicts) creation.push_back("PREDICTOR=" + predictor);
                    draw(path, tiled(type, creation));
                    check_alike(path);
                    draw(path, striped(type, creation));
                    check_alike(path);
                }
}

TEST_CASE("strips are read as GDAL reads them, whatever their rows", "[tiff_layer]") {
    const Folder folder;
    const std::string path = folder / "dem.tif";
    for (const int columns : {2, 257, 1111})
        for (const int strip : {1, 2, 16, 300, 5000})
            for (const std::string packing : {"NONE", "DEFLATE", "ZSTD"}) {
                INFO(columns << " columns, strips of " << strip << " rows, " << packing);
                Drawing d = striped(GDT_Int16, {"BLOCKYSIZE=" + std::to_string(strip), "COMPRESS=" + packing});
                d.columns = columns;
                d.rows = 300;
                d.value = [](int c, int r) { return (c * 7919 + r * 104729) % 30011 - 15000; };
                if (packing != "NONE" && columns * std::min(strip, 300) * 2 > 8 << 16)
                    continue;  // the cache would not keep them
                draw(path, d);
                check_alike(path);
            }
}

TEST_CASE("of strips as they are only what is asked for is read, of packed ones each once", "[tiff_layer]") {
    const Folder folder;
    const std::string path = folder / "dem.tif";
    Drawing d = striped(GDT_Int16);
    d.columns = d.rows = 2000;
    d.value = [](int c, int r) { return (c * 7919 + r * 104729) % 30011; };
    draw(path, d);
    const auto as_is = TiffLayer::of("dem", path, cache());
    REQUIRE(as_is);
    CHECK(as_is->facts().block_columns == 2000);
    CHECK(as_is->facts().unit_columns() == 256);
    CHECK(as_is->facts().unit_rows() == 256);
    CHECK(as_is->decoded_a_post() < 2);
    CHECK_FALSE(as_is->fills_gdal_cache());
    d.creation = {"COMPRESS=DEFLATE", "BLOCKYSIZE=1"};
    draw(path, d);
    const auto held = std::make_shared<TileCache>(std::size_t{16} << 20);
    const auto packed = TiffLayer::of("dem", path, held);
    REQUIRE(packed);
    CHECK(packed->decoded_a_post() == Approx(2000.0 / 1024).epsilon(1e-3));
    std::vector<float> out(100 * 100);
    packed->read_heights({{300, 400}, {500, 600}}, out.data(), 100);
    const std::size_t first = held->bytes();
    CHECK(first == 100 * (4000 + TileCache::entry_bytes));
    packed->read_heights({{1300, 1400}, {500, 600}}, out.data(), 100);
    CHECK(held->bytes() == first);
}

TEST_CASE("values that are no heights are those that GDAL finds", "[tiff_layer]") {
    const Folder folder;
    const std::string path = folder / "dem.tif";
    const double nan = std::numeric_limits<double>::quiet_NaN();
    struct Case {
        GDALDataType type;
        double no_data, written;
    };
    for (const auto& [type, no_data, written] :
         std::vector<Case>{{GDT_Int16, -32768, -32768},
                           {GDT_Int16, 0, 0},
                           {GDT_Int16, 1.5, 1},
                           {GDT_Byte, 255, 255},
                           {GDT_Byte, -9999, 0},
                           {GDT_Int32, -2147483648.0, -2147483648.0},
                           {GDT_Float32, -9999, -9999},
                           {GDT_Float32, -999999, -999999},
                           {GDT_Float32, nan, nan}}) {
        INFO(GDALGetDataTypeName(type) << ' ' << no_data);
        Drawing d = tiled(type);
        d.no_data = no_data;
        d.value = [written = written](int c, int r) { return (c + r) % 9 == 0 ? written : (c * 7 + r) % 200; };
        draw(path, d);
        check_alike(path);
    }
    // What a float cannot hold is GDAL's to compare.
    for (const double no_data : {-std::numeric_limits<double>::max(), -9999.9}) {
        Drawing d = tiled(GDT_Float32);
        d.no_data = no_data;
        draw(path, d);
        CHECK_FALSE(TiffLayer::of("dem", path, cache()));
    }
    // Heights that are none are refused alike.
    Drawing d = tiled(GDT_Float32);
    d.value = [](int c, int r) { return c == 77 && r == 66 ? std::numeric_limits<double>::infinity() : 1; };
    draw(path, d);
    const auto own = TiffLayer::of("dem", path, cache());
    REQUIRE(own);
    std::vector<float> out(150 * 107);
    CHECK_THROWS_AS(own->read_heights({{0, 150}, {0, 107}}, out.data(), 150), DataError);
}

TEST_CASE("grid and CRS are those that GDAL finds", "[tiff_layer]") {
    const Folder folder;
    const std::string path = folder / "dem.tif";
    struct Case {
        std::string crs;
        std::array<double, 6> geotransform;
    };
    for (const auto& [crs, geotransform] : std::vector<Case>{
             {"EPSG:32601", {1000, 10, 0, 2000, 0, -10}},
             {"EPSG:32660", {166021.4431, 30.1, 0, 1e6 / 3, 0, -29.7}},
             {"EPSG:32733", {499980.123456789, 0.3, 0, 9999990.987654321, 0, -0.3}},
             {"EPSG:4326", {-117.00013888888889, 1 / 3600.0, 0, 34.00013888888889, 0, -1 / 3600.0}},
             {"EPSG:4326", {-180, 2.4, 0, 90, 0, -1.5}}}) {
        INFO(crs);
        Drawing d = tiled(GDT_Int16);
        d.crs = crs;
        d.geotransform = geotransform;
        draw(path, d);
        check_alike(path);
        // The tie point is a post.
        update(path, [](GDALDataset& file) { file.SetMetadataItem("AREA_OR_POINT", "Point"); });
        check_alike(path);
    }
}

TEST_CASE("tiles of any shape, tiles that a file leaves out and overviews change nothing", "[tiff_layer]") {
    const Folder folder;
    const std::string path = folder / "dem.tif";
    for (const auto& [wide, high] : std::vector<std::pair<int, int>>{{16, 16}, {16, 128}, {256, 32}, {512, 512}}) {
        INFO(wide << " x " << high);
        Drawing d = tiled(GDT_Int16);
        d.creation = {"TILED=YES", "BLOCKXSIZE=" + std::to_string(wide), "BLOCKYSIZE=" + std::to_string(high),
                      "COMPRESS=ZSTD"};
        draw(path, d);
        check_alike(path);
    }
    for (const bool with_no_data : {false, true}) {
        Drawing d = tiled(GDT_Int16, {"SPARSE_OK=YES"});
        if (with_no_data) d.no_data = -5;
        const double nothing = with_no_data ? -5 : 0;
        d.value = [nothing](int c, int r) { return c < 64 || r >= 64 ? nothing : c; };
        draw(path, d);
        check_alike(path);
    }
    draw(path, tiled(GDT_Int16, {"COMPRESS=DEFLATE"}));
    update(path, [](GDALDataset& file) {
        const int levels[] = {2, 4};
        REQUIRE(file.BuildOverviews("AVERAGE", 2, const_cast<int*>(levels), 0, nullptr, nullptr, nullptr) == CE_None);
    });
    check_alike(path);
}

TEST_CASE("heights have the unit that GDAL finds", "[tiff_layer]") {
    const Folder folder;
    const std::string path = folder / "dem.tif";
    for (const char* unit : {"m", "ft", "US survey foot", "metre", "cm", "unknown"}) {
        INFO(unit);
        Drawing d = tiled(GDT_Int16);
        d.unit = unit;
        draw(path, d);
        CHECK(reads_without_gdal(path));
        check_alike(path);
        update(path, [](GDALDataset& file) { file.SetMetadataItem("AREA_OR_POINT", "Point"); });
        check_alike(path);
    }
    for (const char* unit : {"Pa", "m & more", "m<2", "\xc2\xb5m"}) {
        INFO(unit);
        Drawing d = tiled(GDT_Int16);
        d.unit = unit;
        draw(path, d);
        CHECK_FALSE(reads_without_gdal(path));
    }
}

TEST_CASE("shipped rasters in tiles and WGS84 need no GDAL, and give the same posts", "[tiff_layer]") {
    const std::string data = WEDGESCOPE_DATA "/";
    for (const char* name : {"azores_dem.tif", "inland_empire_canopy.tif", "inland_empire_culture.tif",
                             "inland_empire_dem.tif", "olympic_coast_dem.tif"})
        check_alike(data + name);
    CHECK_FALSE(reads_without_gdal(data + "N44W072.hgt"));
}

TEST_CASE("what is not as it should be in a file's directory is left to GDAL", "[tiff_layer]") {
    const Folder folder;
    const std::string path = folder / "dem.tif";
    const auto left = [&] {
        // Where GDAL has told libtiff of its tags, that may read them as GDAL does.
        if (const auto plain = PlainTiff::of("dem", path)) check_facts(plain->facts, RasterFile("dem", path).facts());
        const Untold untold;
        CHECK_FALSE(reads_without_gdal(path));
    };
    Drawing d = tiled(GDT_Int16, {"COMPRESS=ZSTD", "PREDICTOR=2"});
    d.no_data = 7777;
    const auto drawn = [&](const std::function<void(Directory&)>& change) {
        draw(path, d);
        CHECK(reads_without_gdal(path));
        edit(path, [&](std::string& bytes) {
            Directory directory(bytes);
            change(directory);
        });
        left();
    };
    enum : std::uint16_t { byte = 1, signed_byte = 6, undefined = 7 };
    for (const std::uint16_t type : {byte, signed_byte, undefined}) {
        INFO("no-data as type " << type);
        drawn([&](Directory& directory) { directory.set_type(42113, type); });
    }
    INFO("a word without its end");
    drawn([](Directory& directory) { directory.set_count(42113, 4); });
    INFO("few places of tiles");
    drawn([](Directory& directory) { directory.set_count(324, 5); });
    INFO("few sizes of tiles");
    drawn([](Directory& directory) { directory.set_count(325, 5); });
    for (const std::uint16_t predictor : std::initializer_list<std::uint16_t>{0, 3, 9}) {
        INFO("predictor " << predictor);
        drawn([&](Directory& directory) { directory.set_value(317, predictor); });
    }
    // Words that GDAL reads a scale or a unit from, however they are written.
    for (const std::string item : {R"(<Item name="SCALE" sample="0" role ="scale">2</Item>)",
                                    R"(<Item name="SCALE" sample="0" ROLE="scale">2</Item>)",
                                    R"(<Item name="UNITTYPE" sample="0" role = "unittype">ft</Item>)"}) {
        INFO(item);
        draw(path, d);
        update(path, [&](GDALDataset& file) {
            file.SetMetadataItem("A", std::string(item.size() + 20, 'x').c_str());
        });
        CHECK(reads_without_gdal(path));
        edit(path, [&](std::string& bytes) {
            const std::size_t at = bytes.find("<Item name=\"A\"");
            REQUIRE(at != std::string::npos);
            std::string words = item;
            words.resize(bytes.find("</GDALMetadata>", at) - at, ' ');
            bytes.replace(at, words.size(), words);
        });
        left();
        CHECK(RasterFile("dem", path).facts().scale * RasterFile("dem", path).facts().unit_m != 1);
    }
}

TEST_CASE("rows below the raster may be missing", "[tiff_layer]") {
    const Folder folder;
    const std::string path = folder / "dem.tif";
    for (const std::string packing : {"NONE", "DEFLATE", "PACKBITS"}) {
        INFO(packing);
        draw(path, tiled(GDT_Int16, {"COMPRESS=" + packing}));
        // The last tile anew, with the 43 rows that the raster has of it.
        std::vector<std::uint16_t> tile(64 * 64);
        {
            const std::unique_ptr<TIFF, decltype(&TIFFClose)> file(TIFFOpen(path.c_str(), "r+"), TIFFClose);
            REQUIRE(file);
            const std::uint32_t last = TIFFNumberOfTiles(file.get()) - 1;
            REQUIRE(TIFFReadEncodedTile(file.get(), last, tile.data(), 64 * 64 * 2) == 64 * 64 * 2);
            REQUIRE(TIFFWriteEncodedTile(file.get(), last, tile.data(), 43 * 64 * 2) == 43 * 64 * 2);
        }
        check_alike(path);
    }
}

TEST_CASE("tiles that a file leaves out take no memory", "[tiff_layer]") {
    const Folder folder;
    const std::string path = folder / "dem.tif";
    Drawing d = tiled(GDT_Int16);
    d.columns = d.rows = 2000;
    d.value = [](int c, int r) { return c == 1999 && r == 1999 ? 1 : 0; };
    const std::string packing = GENERATE("NONE", "ZSTD");
    const bool strips = GENERATE(false, true);
    CAPTURE(packing, strips);
    d.creation = {"SPARSE_OK=YES", "COMPRESS=" + packing};
    if (!strips) d.creation.insert(d.creation.end(), {"TILED=YES", "BLOCKXSIZE=512", "BLOCKYSIZE=512"});
    draw(path, d);
    const auto held = cache();
    const auto own = TiffLayer::of("dem", path, held);
    REQUIRE(own);
    std::vector<float> out(2000);
    for (std::int64_t r = 0; r < 1500; r += 100) own->read_heights({{0, 2000}, {r, r + 1}}, out.data(), 2000);
    CHECK(held->bytes() == 0);
    CHECK(own->reader_bytes().decoded <= (packing == "NONE" ? std::size_t{1} << 17 : std::size_t{1} << 19));
}

TEST_CASE("a file of which GDAL may know more is left to GDAL", "[tiff_layer]") {
    const Folder folder;
    const std::string path = folder / "dem.tif";
    // Its facts; its posts too where they are not plain, or masked.
    enum class Posts { here, by_gdal };
    const auto left = [&](const std::string& why, Posts posts = Posts::here) {
        INFO(why);
        {
            const Untold untold;
            CHECK_FALSE(reads_without_gdal(path));
        }
        CHECK_FALSE(TiffLayer::of("dem", path, cache()));
        CHECK_FALSE(reads_without_gdal(path));
        const auto opened = open_raster("dem", path, cache());
        CHECK((dynamic_cast<RasterFile*>(opened.get()) != nullptr) == (posts == Posts::by_gdal));
        RasterFile gdal("dem", path);
        check_told(opened->facts(), gdal.facts());
        check_posts(*opened, gdal);
        CHECK(opened->fingerprint({}) == gdal.fingerprint({}));
    };
    const auto drawn = [&](const std::string& why, Drawing d, Posts posts = Posts::here) {
        std::filesystem::remove(path + ".aux.xml");
        draw(path, d);
        left(why, posts);
    };
    const auto changed = [&](const std::string& why, const Change& change) {
        std::filesystem::remove(path + ".aux.xml");
        draw(path, tiled(GDT_Int16));
        CHECK(reads_without_gdal(path));
        update(path, change);
        left(why);
    };
    const auto with = [&](const std::function<void(Drawing&)>& change, GDALDataType type = GDT_Int16) {
        Drawing d = tiled(type);
        change(d);
        return d;
    };
    drawn("two bands", with([](Drawing& d) { d.bands = 2; }), Posts::by_gdal);
    drawn("scale", with([](Drawing& d) { d.scale = 0.1; }));
    drawn("offset", with([](Drawing& d) { d.offset = 10; }));
    drawn("scale and unit", with([](Drawing& d) { d.scale = 0.1, d.unit = "ft"; }));
    drawn("mask", with([](Drawing& d) { d.masked = [](int c, int) { return c == 3; }; }), Posts::by_gdal);
    drawn("no CRS", with([](Drawing& d) { d.crs.clear(); }));
    drawn("no grid", with([](Drawing& d) { d.geotransform.reset(); }));
    drawn("rows that grow north", with([](Drawing& d) { (*d.geotransform)[5] = 10; }));
    drawn("rotated", with([](Drawing& d) { (*d.geotransform)[2] = (*d.geotransform)[4] = 1e-7; }));
    for (const char* crs : {"EPSG:4269", "EPSG:26911", "EPSG:3857", "EPSG:32661", "EPSG:2231", "EPSG:32611+5703",
                            "+proj=utm +zone=11 +datum=WGS84 +units=us-ft", "+proj=aeqd +lat_0=34 +lon_0=-117"})
        drawn(crs, with([&](Drawing& d) { d.crs = crs; }));
    drawn("half of a byte", with([](Drawing& d) { d.creation.push_back("NBITS=4"); }, GDT_Byte), Posts::by_gdal);
    drawn("12 bits", with([](Drawing& d) { d.creation.push_back("NBITS=12"); }, GDT_UInt16), Posts::by_gdal);
    drawn("signed bytes", with([](Drawing& d) { d.creation.push_back("PIXELTYPE=SIGNEDBYTE"); }, GDT_Byte),
          Posts::by_gdal);
    drawn("white is 0", with([](Drawing& d) { d.creation.push_back("PHOTOMETRIC=MINISWHITE"); }, GDT_Byte),
          Posts::by_gdal);
    drawn("another packing", with([](Drawing& d) { d.creation.push_back("COMPRESS=LZMA"); }), Posts::by_gdal);
    changed("a scale, later", [](GDALDataset& file) { file.GetRasterBand(1)->SetScale(2); });
    changed("a description", [](GDALDataset& file) { file.GetRasterBand(1)->SetDescription("heights"); });
    changed("a domain of metadata", [](GDALDataset& file) { file.SetMetadataItem("A", "B", "C"); });
    std::filesystem::remove(path + ".aux.xml");
    draw(path, tiled(GDT_Int16));
    for (const char* beside : {"dem.tif.aux.xml", "dem.tif.msk", "dem.aux", "dem.tif.Msk", "DEM.TIF.msk"}) {
        CHECK(reads_without_gdal(path));
        std::ofstream(folder / beside) << "<PAMDataset/>";
        left(beside);
        std::filesystem::remove(folder / beside);
    }
    CHECK_FALSE(reads_without_gdal(folder / "none.tif"));
    CHECK_FALSE(reads_without_gdal(folder / ""));
    {
        const GdalSession configured(std::size_t{16} << 20, {{"GTIFF_POINT_GEO_IGNORE", "YES"}});
        left("--config");
    }
    const GdalSession again(std::size_t{16} << 20, {});
    for (const char* name : {"GTIFF_POINT_GEO_IGNORE", "GDAL_GEOREF_SOURCES", "OSR_USE_ETMERC"}) {
        CHECK(reads_without_gdal(path));
        ::setenv(name, "NO", 1);
        left(name);
        ::unsetenv(name);
    }
    // A large tile that the cache would not keep is unpacked once by GDAL.
    Drawing large = tiled(GDT_Int16);
    large.columns = large.rows = 1030;
    large.creation = {"TILED=YES", "BLOCKXSIZE=1024", "BLOCKYSIZE=1024"};
    draw(path, large);
    CHECK(TiffLayer::of("dem", path, cache()));  // as it is, it needs none
    large.creation.push_back("COMPRESS=ZSTD");
    draw(path, large);
    CHECK_FALSE(TiffLayer::of("dem", path, cache()));
    CHECK(TiffLayer::of("dem", path, std::make_shared<TileCache>(std::size_t{33} << 20)));
    large.creation = {"COMPRESS=DEFLATE", "BLOCKYSIZE=1030"};
    draw(path, large);
    CHECK_FALSE(TiffLayer::of("dem", path, cache()));
}

TEST_CASE("a damaged tile is named by the posts that it holds", "[tiff_layer]") {
    const Folder folder;
    const std::string path = folder / "dem.tif";
    const std::string packing = GENERATE("NONE", "ZSTD", "DEFLATE");
    const bool strips = GENERATE(false, true);
    CAPTURE(packing, strips);
    Drawing d = strips ? striped(GDT_Int16, {"BLOCKYSIZE=64", "COMPRESS=" + packing})
                       : tiled(GDT_Int16, {"COMPRESS=" + packing});
    d.value = [](int c, int r) { return (c * 7919 + r * 104729) % 30011; };  // hardly shrinks
    draw(path, d);
    // The last tile is at the end of the file; of its rows the last 21 are nobody's. A strip has none such.
    std::filesystem::resize_file(path, std::filesystem::file_size(path) - (packing == "NONE" && !strips ? 3500 : 100));
    const auto own = TiffLayer::of("dem", path, cache());
    REQUIRE(own);
    std::vector<float> out(150 * 107);
    own->read_heights({{0, 128}, {0, 64}}, out.data(), 150);
    for (int again = 0; again < 2; ++again)
        try {
            own->read_heights({{0, 150}, {0, 107}}, out.data(), 150);
            FAIL("it is read");
        } catch (const IoError& e) {
            INFO(e.what());
            CHECK_THAT(e.what(), Catch::Contains("dem '" + path + "': columns " + (strips ? "0" : "128") +
                                                 " to 149, rows 64 to 106 cannot be read: "));
            CHECK(std::string(e.what()).find('\n') == std::string::npos);
        }
}

TEST_CASE("a file that is cut short in its directory is GDAL's to refuse", "[tiff_layer]") {
    const Folder folder;
    const std::string path = folder / "dem.tif";
    draw(path, tiled(GDT_Int16));
    edit(path, [](std::string& bytes) { bytes.resize(60); });
    CHECK_FALSE(reads_without_gdal(path));
    CHECK_THROWS_AS(open_raster("dem", path), IoError);
}

TEST_CASE("threads read the posts that one reads", "[tiff_layer][threads]") {
    const Folder folder;
    const std::string path = folder / "dem.tif";
    const std::string packing = GENERATE("NONE", "ZSTD", "LZW");
    const bool strips = GENERATE(false, true);
    CAPTURE(packing, strips);
    Drawing d = strips ? striped(GDT_Int16, {"COMPRESS=" + packing}) : tiled(GDT_Int16, {"COMPRESS=" + packing});
    d.columns = d.rows = 400;
    draw(path, d);
    const auto few = std::make_shared<TileCache>(std::size_t{16} * 64 * 64 * 2);  // of 49 tiles
    const auto own = TiffLayer::of("dem", path, few);
    REQUIRE(own);
    std::atomic<int> wrong{0};
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; ++t)
        threads.emplace_back([&, t] {
            for (int i = 0; i < 60; ++i) {
                const int c = (t * 131 + i * 37) % 300, r = (t * 71 + i * 53) % 300;
                std::vector<float> out(100 * 100);
                own->read_heights({{c, c + 100}, {r, r + 100}}, out.data(), 100);
                for (int y = 0; y < 100; ++y)
                    for (int x = 0; x < 100; ++x)
                        wrong += out[static_cast<std::size_t>(y * 100 + x)] !=
                                 static_cast<float>(((c + x) * 7 + (r + y) * 13) % 251);
            }
        });
    for (std::thread& one : threads) one.join();
    CHECK(wrong == 0);
    CHECK(few->bytes() <= few->most_bytes());
    CHECK((few->bytes() > 0) == (packing != "NONE"));
}
