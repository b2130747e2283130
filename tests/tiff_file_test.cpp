// GeoTIFFs written without GDAL, read back by GDAL, beside what GDAL's own driver writes of the same.
#include <catch2/catch.hpp>

#include <unistd.h>

#include <cpl_string.h>
#include <fcntl.h>
#include <tiffio.h>
#include <xtiffio.h>

#include <fstream>
#include <iterator>
#include <map>
#include <random>
#include <thread>

#include "lib/error.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/refusal.hpp"
#include "tests/small_disk.hpp"
#include "tiles/coverage_raster.hpp"
#include "tiles/pack_bits.hpp"
#include "tiles/raster_layer.hpp"
#include "tiles/raster_writer.hpp"
#include "tiles/tiff_file.hpp"

using namespace wedgescope;
using Catch::Matchers::Contains;
using wedgescope::test::Folder;
using wedgescope::test::SmallDisk;

namespace {

std::optional<GeoTiffCrs> tiff_crs(const std::string& wkt) {
    std::string reason;
    const auto crs = Crs::read(wkt, reason);
    return crs ? crs->in_geotiff() : std::nullopt;
}

constexpr std::int64_t edge = TiffFile::edge;
using Tile = std::vector<std::uint8_t>;
using Tiles = std::map<std::pair<std::int64_t, std::int64_t>, Tile>;  ///< by row and column

/// Runs, single cells and noise, all of a tile's cells: those beyond the raster's edge too.
Tile drawn_tile(std::uint32_t seed) {
    std::mt19937 random(seed);
    Tile cells(static_cast<std::size_t>(edge * edge));
    for (std::size_t i = 0; i < cells.size();) {
        const std::size_t length = std::min<std::size_t>(random() % 4 == 0 ? random() % 600 : 1, cells.size() - i);
        std::fill_n(cells.begin() + static_cast<std::ptrdiff_t>(i), length, static_cast<std::uint8_t>(random()));
        i += length;
    }
    return cells;
}

/// All tiles of a raster but every `missing`th.
Tiles drawn_tiles(std::int64_t columns, std::int64_t rows, int missing) {
    Tiles tiles;
    int n = 0;
    for (std::int64_t r = 0; r * edge < rows; ++r)
        for (std::int64_t c = 0; c * edge < columns; ++c)
            if (++n % missing != 0) tiles[{r, c}] = drawn_tile(static_cast<std::uint32_t>(n));
    return tiles;
}

std::string wkt_of(const OGRSpatialReference& crs) {
    const char* const options[] = {"FORMAT=WKT2_2019", nullptr};
    char* words = nullptr;
    if (crs.exportToWkt(&words, options) != OGRERR_NONE) throw std::runtime_error("a CRS without WKT");
    const std::string wkt = words;
    CPLFree(words);
    return wkt;
}

std::string wkt_of(const std::string& definition) {
    if (definition.empty()) return "";
    OGRSpatialReference crs;
    if (crs.SetFromUserInput(definition.c_str()) != OGRERR_NONE) throw std::runtime_error("no CRS " + definition);
    return wkt_of(crs);
}

TiffContent sized(std::int64_t columns, std::int64_t rows) {
    TiffContent content;
    content.columns = columns;
    content.rows = rows;
    return content;
}

void write_ours(const std::string& path, const TiffContent& content, const Tiles& tiles,
                std::optional<std::uint8_t> no_data) {
    TiffFile file(path, content, path);
    for (const auto& [at, cells] : tiles) file.write_tile(at.second, at.first, cells.data());
    file.close(no_data);
}

/// By GDAL's driver, as rasters of patches are written.
void write_theirs(const std::string& path, const TiffContent& content, const std::string& crs, const Tiles& tiles,
                  std::optional<std::uint8_t> no_data) {
    register_usual_drivers();
    RasterContent same;
    same.columns = content.columns;
    same.rows = content.rows;
    same.type = GDT_Byte;
    same.patches = true;
    same.bands.resize(1);
    same.bands[0].description = content.description;
    same.metadata = content.metadata;
    same.crs = crs;
    same.geotransform = content.geotransform;
    OutputFile file(path, true);
    DatasetHandle dataset = create_raster(same, file, {});
    for (const auto& [at, cells] : tiles)
        REQUIRE(dataset->GetRasterBand(1)->WriteBlock(static_cast<int>(at.second), static_cast<int>(at.first),
                                                      const_cast<std::uint8_t*>(cells.data())) == CE_None);
    // GDAL's close fills with it.
    if (no_data.value_or(0) != 0)
        for (std::int64_t r = 0; r * edge < content.rows; ++r)
            for (std::int64_t c = 0; c * edge < content.columns; ++c)
                if (!tiles.contains({r, c})) {
                    Tile blank(static_cast<std::size_t>(edge * edge));
                    REQUIRE(dataset->GetRasterBand(1)->WriteBlock(static_cast<int>(c), static_cast<int>(r),
                                                                  blank.data()) == CE_None);
                }
    if (no_data) dataset->GetRasterBand(1)->SetNoDataValue(*no_data);
    close_raster(std::move(dataset), path);
    file.commit();
}

using Facts = std::map<std::string, std::string>;

void add_lists(Facts& facts, const std::string& of, GDALMajorObject& object) {
    const CPLStringList domains(object.GetMetadataDomainList());
    for (int d = 0; d < domains.Count(); ++d) {
        if (std::string(domains[d]) == "DERIVED_SUBDATASETS") continue;  // names the file
        facts[of + " domains"] += std::string(domains[d]) + ";";
        const CPLStringList items(CSLDuplicate(object.GetMetadata(domains[d])));
        for (int i = 0; i < items.Count(); ++i) facts[of + " " + domains[d]] += std::string(items[i]) + "\n";
    }
}

DatasetHandle opened(const std::string& path) {
    GDALAllRegister();
    DatasetHandle in(GDALDataset::Open(path.c_str()));
    if (!in) throw std::runtime_error("cannot open " + path);
    return in;
}

/// What GDAL reads but does not tell: other readers may look at it.
void add_tags(Facts& facts, const std::string& path) {
    TIFF* const in = XTIFFOpen(path.c_str(), "r");
    if (!in) throw std::runtime_error("libtiff cannot open " + path);
    for (const std::uint32_t tag : {TIFFTAG_BITSPERSAMPLE, TIFFTAG_COMPRESSION, TIFFTAG_PHOTOMETRIC,
                                    TIFFTAG_SAMPLESPERPIXEL, TIFFTAG_PLANARCONFIG, TIFFTAG_SAMPLEFORMAT}) {
        std::uint16_t value = 0;
        facts["tags"] += TIFFGetField(in, tag, &value) == 1 ? text(tag, " ", value, ", ") : text("no ", tag, ", ");
    }
    std::uint16_t numbers = 0, sizes = 0;
    const std::uint16_t* number = nullptr;
    const double* size = nullptr;
    const char* words = "";
    TIFFGetField(in, TIFFTAG_GEODOUBLEPARAMS, &sizes, &size);
    TIFFGetField(in, TIFFTAG_GEOASCIIPARAMS, &words);
    if (TIFFGetField(in, TIFFTAG_GEOKEYDIRECTORY, &numbers, &number) == 1)
        for (std::size_t i = 4; i + 3 < numbers; i += 4) {
            const std::uint16_t *key = number + i, where = key[1], count = key[2], at = key[3];
            facts["keys"] += where == 0                        ? text(key[0], " ", at, ", ")
                             : where == TIFFTAG_GEOASCIIPARAMS ? text(key[0], " ", std::string(words + at, count), ", ")
                                                               : text(key[0], " ", size[at], ", ");
        }
    XTIFFClose(in);
}

/// All that GDAL says of a file but its pixels and its name.
Facts facts_of(const std::string& path) {
    const DatasetHandle in = opened(path);
    Facts facts;
    add_tags(facts, path);
    GDALRasterBand& band = *in->GetRasterBand(1);
    facts["size"] = text(in->GetRasterXSize(), " x ", in->GetRasterYSize(), " x ", in->GetRasterCount());
    int columns = 0, rows = 0;
    band.GetBlockSize(&columns, &rows);
    facts["block"] = text(columns, " x ", rows);
    facts["type"] = GDALGetDataTypeName(band.GetRasterDataType());
    facts["colour"] = GDALGetColorInterpretationName(band.GetColorInterpretation());
    facts["description"] = band.GetDescription();
    facts["unit"] = band.GetUnitType();
    facts["overviews, masks"] = text(band.GetOverviewCount(), " ", band.GetMaskFlags());
    int declared = 0;
    const double no_data = band.GetNoDataValue(&declared);
    facts["no data"] = declared ? text(no_data) : "none";
    std::array<double, 6> terms{};
    facts["geotransform"] = in->GetGeoTransform(terms.data()) == CE_None ? "" : "none";
    for (const double term : terms) facts["geotransform"] += text(" ", term);
    if (const OGRSpatialReference* crs = in->GetSpatialRef()) {
        facts["crs"] = wkt_of(*crs);
        for (const int axis : crs->GetDataAxisToSRSAxisMapping()) facts["axes"] += text(axis, " ");
    }
    facts["ground control points"] = text(in->GetGCPCount());
    facts["files"] = text(CPLStringList(in->GetFileList()).Count());
    add_lists(facts, "file's", *in);
    add_lists(facts, "band's", band);
    return facts;
}

std::vector<std::uint8_t> cells_of(const std::string& path) {
    const DatasetHandle in = opened(path);
    const int columns = in->GetRasterXSize(), rows = in->GetRasterYSize();
    std::vector<std::uint8_t> cells(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
    if (in->GetRasterBand(1)->RasterIO(GF_Read, 0, 0, columns, rows, cells.data(), columns, rows, GDT_Byte, 0, 0) !=
        CE_None)
        throw std::runtime_error("cannot read " + path);
    return cells;
}

/// Of a raster of so many columns, those that are not as drawn; 0 where there is no tile.
std::size_t wrong_cells(const std::string& path, std::int64_t columns, const Tiles& tiles) {
    const std::vector<std::uint8_t> cells = cells_of(path);
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < cells.size(); ++i) {
        const auto c = static_cast<std::int64_t>(i) % columns, r = static_cast<std::int64_t>(i) / columns;
        const auto tile = tiles.find({r / edge, c / edge});
        const int drawn = tile == tiles.end() ? 0 : tile->second[static_cast<std::size_t>(r % edge * edge + c % edge)];
        wrong += cells[i] != drawn;
    }
    return wrong;
}

std::string first_bytes(const std::string& path, std::size_t count) {
    std::string bytes(count, '?');
    std::ifstream(path, std::ios::binary).read(bytes.data(), static_cast<std::streamsize>(count));
    return bytes;
}
bool is_big(const std::string& path) { return first_bytes(path, 4)[2] == 43; }

/// What is written to standard error meanwhile.
class HeardErrors {
public:
    explicit HeardErrors(const std::string& path) : path_(path), before_(::dup(2)) {
        const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
        ::dup2(file, 2);
        ::close(file);
    }
    ~HeardErrors() { restore(); }
    HeardErrors(const HeardErrors&) = delete;
    HeardErrors& operator=(const HeardErrors&) = delete;
    std::string end() {
        restore();
        std::ifstream in(path_);
        return {std::istreambuf_iterator<char>(in), {}};
    }

private:
    void restore() {
        if (before_ < 0) return;
        ::dup2(before_, 2);
        ::close(before_);
        before_ = -1;
    }
    std::string path_;
    int before_;
};

const std::string long_json = [] {
    std::string json = R"({"words":"<a> & \"b\" 'c' &amp; ]]>)";
    for (int i = 0; i < 20000; ++i) json += text(",", i);
    return json + "\"}";
}();

}  // namespace

TEST_CASE("a TIFF of any size holds the tiles it was given, and 0 where none came", "[tiff_file]") {
    const Folder folder;
    const std::string path = folder / "a.tif";
    for (const auto& [columns, rows] : std::vector<std::pair<std::int64_t, std::int64_t>>{
             {1, 1}, {256, 256}, {257, 255}, {900, 700}, {1, 1000}, {1500, 3}})
        for (const int missing : {1, 2, 3, 1000}) {
            CAPTURE(columns, rows, missing);
            const Tiles tiles = drawn_tiles(columns, rows, missing);
            write_ours(path, sized(columns, rows), tiles, std::nullopt);
            CHECK(wrong_cells(path, columns, tiles) == 0);
            const Facts facts = facts_of(path);
            CHECK(facts.at("size") == text(columns, " x ", rows, " x 1"));
            CHECK(facts.at("block") == "256 x 256");
            CHECK(facts.at("no data") == "none");
            CHECK(facts.at("geotransform") == "none 0 1 0 0 0 1");
            CHECK_FALSE(facts.contains("crs"));
        }
}

TEST_CASE("tiles stand in the file in the order they come, those that did not come behind them, each at its own place",
          "[tiff_file]") {
    const Folder folder;
    const std::string path = folder / "a.tif";
    {
        TiffFile file(path, sized(1000, 500), path);
        for (const std::int64_t column : {2, 0, 3}) file.write_tile(column, 1, drawn_tile(1).data());
        file.close(7);
    }
    const DatasetHandle in = opened(path);
    const auto place = [&](int column, int row, const char* what = "OFFSET") {
        const char* words =
            in->GetRasterBand(1)->GetMetadataItem(text("BLOCK_", what, "_", column, "_", row).c_str(), "TIFF");
        return words ? std::stol(words) : 0;
    };
    CHECK(place(2, 1) == 8);
    CHECK(place(0, 1) == place(2, 1) + place(2, 1, "SIZE"));
    CHECK(place(0, 1) < place(3, 1));
    CHECK(place(3, 1) < place(0, 0));
    CHECK(place(0, 0) < place(1, 0));
    CHECK(place(1, 0) < place(1, 1));
    CHECK(place(1, 1, "SIZE") == 1024);
}

TEST_CASE("to GDAL a TIFF is what its own driver writes of the same", "[tiff_file]") {
    const Folder folder;
    const std::string ours = folder / "ours.tif", theirs = folder / "theirs.tif";
    struct Case {
        std::string crs;
        std::optional<std::array<double, 6>> geotransform;
        std::optional<std::uint8_t> no_data;
    };
    using Terms = std::array<double, 6>;
    const Terms north_up{400000, 30, 0, 4500000, 0, -30}, south_up{400000, 30, 0, 4200000.1, 0, 1.0 / 3},
        degrees{-117.00013888888889, 1.0 / 10800, 0, 40.1, 0, -1.0 / 10800}, bare{0, 1, 0, 0, 0, -1},
        upside_down{0, 1, 0, 0, 0, 1}, leftward{10, -2, 0, 20, 0, -3};
    const std::vector<Case> cases = {
        {"", std::nullopt, std::nullopt},
        {"", north_up, 1},
        {"", bare, 255},
        {"", upside_down, 0},
        {"", leftward, 3},
        {"EPSG:32611", north_up, 1},
        {"EPSG:32611", south_up, 0},
        {"EPSG:32611", std::nullopt, std::nullopt},
        {"EPSG:2263", north_up, 9},  // US survey feet
        {"EPSG:2222", north_up, 9},  // feet
        {"EPSG:3857", south_up, 255},
        {"EPSG:4809", degrees, 1},    // of a meridian other than Greenwich
        {"EPSG:31467", north_up, 1},  // northing first
        {"EPSG:2193", north_up, 1},
        {"EPSG:3413", south_up, 1},
        {"EPSG:4326", degrees, 1},
        {"EPSG:4269", degrees, std::nullopt},
        {"EPSG:4258", degrees, 0},
        {"EPSG:4047", degrees, 1},  // a sphere
    };
    for (const bool told : {false, true})
        for (const Case& c : cases) {
            CAPTURE(c.crs, told);
            TiffContent content = sized(300, 260);
            content.geotransform = c.geotransform;
            const std::string wkt = wkt_of(c.crs);
            if (!wkt.empty()) {
                content.crs = tiff_crs(wkt);
                REQUIRE(content.crs);
            }
            if (told) {
                content.description = "what <is> \"seen\" & not";
                content.metadata = {{"SOFTWARE", "wedgescope"},
                                    {"SCENE_JSON", long_json},
                                    {"a<b>&\"c", "x\ty\nz"},
                                    {"empty", ""},
                                    {"Umlaut", "\xc3\xa4 \xe2\x82\xac"},
                                    {"BELL", "a\ab"},
                                    {"_A", " spaces "},
                                    {"AB", "1"}};
            }
            const Tiles tiles = drawn_tiles(content.columns, content.rows, 3);
            write_ours(ours, content, tiles, c.no_data);
            write_theirs(theirs, content, wkt, tiles, c.no_data);
            CHECK(facts_of(ours) == facts_of(theirs));
            CHECK((cells_of(ours) == cells_of(theirs)));  // not a page of them where they differ
            CHECK(wrong_cells(ours, content.columns, tiles) == 0);
        }
    // And that is what was meant.
    TiffContent content = sized(300, 260);
    content.crs = tiff_crs(wkt_of("EPSG:32611"));
    content.geotransform = south_up;
    content.description = "a & b";
    content.metadata = {{"SCENE_JSON", long_json}};
    write_ours(ours, content, {}, 17);
    const Facts facts = facts_of(ours);
    CHECK(facts.at("no data") == "17");
    CHECK(facts.at("description") == "a & b");
    CHECK_THAT(facts.at("crs"), Contains("ID[\"EPSG\",32611]]"));
    CHECK(facts.at("geotransform") == " 400000 30 0 4200000.1 0 0.3333333333333333");
    CHECK_THAT(facts.at("file's "), Contains("SCENE_JSON=" + long_json + "\n") && Contains("AREA_OR_POINT=Area\n"));
}

TEST_CASE("a CRS that EPSG's code does not tell all of is left to GDAL", "[tiff_file]") {
    CHECK(tiff_crs(wkt_of("EPSG:32611")));
    const std::string ours = "+proj=tmerc +lon_0=9 +ellps=GRS80 +units=m +no_defs";
    for (const std::string& crs :
         {ours, std::string("+proj=longlat +ellps=bessel +towgs84=598,73,418,0,0,0,0 +no_defs"),
          std::string("EPSG:4979"), std::string("EPSG:4978"), std::string("EPSG:5703"),
          std::string("ESRI:54009"), std::string("OGC:CRS84"), std::string("IAU_2015:30100"), std::string("EPSG:8857"),
          std::string("EPSG:6247"), std::string("EPSG:4807"), std::string("EPSG:27572"), std::string("EPSG:24370")}) {
        CAPTURE(crs);
        CHECK_FALSE(tiff_crs(wkt_of(crs)));
    }
    for (const char* words : {"", "nonsense", "PROJCRS[", "LOCAL_CS[\"here\",UNIT[\"metre\",1]]"})
        CHECK_FALSE(tiff_crs(words));
    // Of one with heights its horizontal part.
    CHECK(tiff_crs(wkt_of("EPSG:32611+5703")) == tiff_crs(wkt_of("EPSG:32611")));
    // With a shift of its own: no longer what the code says.
    OGRSpatialReference shifted;
    shifted.importFromEPSG(31467);
    shifted.SetTOWGS84(1, 2, 3, 0, 0, 0, 0);
    CHECK_FALSE(tiff_crs(wkt_of(shifted)));
}

TEST_CASE("a TIFF is a big one where GDAL would make it so to be safe", "[tiff_file]") {
    const Folder folder;
    const std::string ours = folder / "ours.tif", theirs = folder / "theirs.tif";
    register_usual_drivers();
    for (const auto& [columns, rows, big] : std::vector<std::tuple<int, int, bool>>{{40000, 49664, false},
                                                                                    {40000, 49665, true},
                                                                                    {1, 7812352, false},
                                                                                    {1, 7812353, true},
                                                                                    {300000, 6656, false},
                                                                                    {300000, 6657, true}}) {
        CAPTURE(columns, rows);
        TiffFile file(ours, sized(columns, rows), ours);  // its first bytes stand
        CHECK(is_big(ours) == big);
        RasterFormat sparse;
        sparse.creation = {"SPARSE_OK=TRUE"};
        RasterContent content;
        content.columns = columns;
        content.rows = rows;
        content.type = GDT_Byte;
        content.patches = true;
        content.bands.resize(1);
        OutputFile output(theirs, true);
        close_raster(create_raster(content, output, sparse), theirs);
        CHECK(is_big(output.temporary_path()) == big);
    }
    // And what it holds is found again.
    {
        TiffFile file(ours, sized(40000, 49665), ours);
        file.write_tile(156, 194, drawn_tile(5).data());
        file.close(3);
    }
    CHECK(is_big(ours));
    const DatasetHandle in = opened(ours);
    Tile cells(static_cast<std::size_t>(edge * edge), 9);
    REQUIRE(in->GetRasterBand(1)->ReadBlock(156, 194, cells.data()) == CE_None);
    CHECK(cells[64] != 9);
    CHECK(cells[0] == drawn_tile(5)[0]);
    for (const auto& [column, row] : {std::pair{0, 0}, std::pair{156, 193}, std::pair{77, 100}}) {
        REQUIRE(in->GetRasterBand(1)->ReadBlock(column, row, cells.data()) == CE_None);
        CHECK((cells == Tile(cells.size(), 0)));
    }
}

TEST_CASE("a TIFF that does not fit on the disk is an error with the system's reason, and libtiff says nothing",
          "[tiff_file]") {
    const Folder folder;
    const std::string path = folder / "a.tif";
    Tile noise(static_cast<std::size_t>(edge * edge));
    std::mt19937 random(1);
    for (std::uint8_t& cell : noise) cell = static_cast<std::uint8_t>(random());
    TiffContent content = sized(1024, 256);
    content.crs = tiff_crs(wkt_of("EPSG:32611"));
    content.metadata = {{"SCENE_JSON", long_json}};
    std::string where;
    const auto write = [&](const std::string& to, std::size_t tiles) {
        where = "begin";
        TiffFile file(to, content, "final.tif");
        for (std::size_t i = 0; i < tiles; ++i) {
            where = "write";
            file.write_tile(static_cast<std::int64_t>(i), 0, noise.data());
        }
        where = "close";
        file.close(1);
        where = "end";
    };
    write(path, 4);
    CHECK(where == "end");
    const auto whole = static_cast<rlim_t>(std::filesystem::file_size(path));
    struct Case {
        rlim_t most;
        std::size_t tiles;
        std::string where;
    };
    // At its first bytes, in a tile, in tiles that did not come, at its directory's start and at its last byte.
    for (const Case& c :
         {Case{0, 4, "begin"}, Case{3, 4, "begin"}, Case{1000, 4, "write"}, Case{100000, 4, "write"},
          Case{1000, 0, "close"}, Case{2000, 0, "close"}, Case{4104, 0, "close"}, Case{whole - 1, 4, "close"}}) {
        CAPTURE(c.most, c.tiles);
        HeardErrors heard(folder / "heard");
        const std::string message = [&] {
            const SmallDisk disk(c.most);
            return test::refusal<IoError>([&] { write(path, c.tiles); });
        }();
        CHECK(heard.end().empty());
        CHECK(message == "output 'final.tif' cannot be written: File too large");
        CHECK(where == c.where);
    }
    {
        const SmallDisk disk(whole);
        CHECK_NOTHROW(write(path, 4));
    }
    CHECK(test::refusal<IoError>([&] { write("/dev/full", 4); }) ==
          "output 'final.tif' cannot be written: No space left on device");
    CHECK(test::refusal<IoError>([&] { write(folder / "none/a.tif", 4); }) ==
          "output 'final.tif' cannot be written: No such file or directory");
}

TEST_CASE("threads write TIFFs side by side, and a failing one disturbs none", "[tiff_file][threads]") {
    const Folder folder;
    constexpr int threads = 4, files = 8;
    const Tiles tiles = drawn_tiles(700, 600, 4);
    TiffContent content = sized(700, 600);
    const std::string wkt = wkt_of("EPSG:4326");
    std::array<std::size_t, threads> refused{};
    {
        std::vector<std::jthread> all;
        for (int t = 0; t < threads; ++t)
            all.emplace_back([&, t] {
                for (int f = 0; f < files; ++f) {
                    TiffContent own = content;
                    own.crs = tiff_crs(wkt);
                    own.description = text("of ", t, " ", f);
                    write_ours(folder / text(t, "_", f, ".tif"), own, tiles, 1);
                    try {
                        write_ours("/dev/full", own, tiles, 1);
                    } catch (const IoError&) {
                        ++refused[static_cast<std::size_t>(t)];
                    }
                }
            });
    }
    for (int t = 0; t < threads; ++t) {
        CHECK(refused[static_cast<std::size_t>(t)] == files);
        for (int f = 0; f < files; ++f) {
            const std::string path = folder / text(t, "_", f, ".tif");
            CHECK(facts_of(path).at("description") == text("of ", t, " ", f));
            CHECK(wrong_cells(path, 700, tiles) == 0);
        }
    }
}

TEST_CASE("a mask as a GeoTIFF needs no driver of GDAL's; other outputs do", "[tiff_file]") {
    const Folder folder;
    DataBase db;
    db.columns = 300;
    db.rows = 260;
    db.origin_x = 400015;
    db.origin_y = 4499985;
    db.step_x = 30;
    db.step_y = -30;
    db.crs_wkt = wkt_of("EPSG:32611");
    const Tile cells = drawn_tile(1);
    const auto write = [&](const std::string& name, CoverageLayer kind, const RasterFormat& format,
                           bool counts = false) {
        CoverageFile::Layer layer;
        layer.kind = kind;
        layer.counts = counts;
        OutputFile output(folder / name, true);
        CoverageFile file(3, db, layer, output, format);
        CHECK(file.by_tiles());
        file.write(CoverageTile{.window = {{0, 256}, {0, 256}}, .bytes = cells.data(), .stride = edge});
        const Tile hidden(cells.size(), 0);
        file.write(CoverageTile{.window = {{256, 300}, {0, 256}}, .bytes = hidden.data(), .stride = edge});
        file.write(CoverageTile{.window = {{0, 256}, {256, 260}}, .bytes = hidden.data(), .stride = edge});
        file.write(CoverageTile{.window = {{256, 300}, {256, 260}}, .bytes = cells.data(), .stride = edge});
        file.close(5);
        output.commit();
    };
    RasterFormat plain, chosen, named, other;
    chosen.creation = {"COMPRESS=PACKBITS"};
    named.driver = "gtiff";
    other.driver = "no driver of this name";
    register_usual_drivers();
    register_all_drivers();
    write("theirs.tif", CoverageLayer::mask, chosen);
    const std::string wkt = db.crs_wkt;
    {
        GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName("GTiff");
        REQUIRE(driver);
        GetGDALDriverManager()->DeregisterDriver(driver);
        for (const char* name : {"ours.tif", "ours.tiff", "OURS.TIF"})
            CHECK_NOTHROW(write(name, CoverageLayer::mask, plain));
        db.crs_wkt.clear();
        CHECK_NOTHROW(write("bare.tif", CoverageLayer::mask, plain));
        db.crs_wkt = wkt_of("ESRI:54009");
        CHECK_THROWS_AS(write("a.tif", CoverageLayer::mask, plain), InputError);
        db.crs_wkt = wkt;
        CHECK_THROWS_AS(write("a.tif", CoverageLayer::mask, chosen), InputError);
        CHECK_NOTHROW(write("named.dat", CoverageLayer::mask, named));
        CHECK_THROWS_AS(write("a.tif", CoverageLayer::mask, other), InputError);
        CHECK_THROWS_AS(write("a.tif", CoverageLayer::states, plain), InputError);
        CHECK_THROWS_AS(write("a.tif", CoverageLayer::mask, plain, true), InputError);
        GetGDALDriverManager()->RegisterDriver(driver);
    }
    for (const char* name : {"ours.tif", "ours.tiff", "OURS.TIF", "named.dat"}) {
        CHECK(facts_of(folder / name) == facts_of(folder / "theirs.tif"));
        CHECK((cells_of(folder / name) == cells_of(folder / "theirs.tif")));
    }
    const Facts facts = facts_of(folder / "ours.tif");
    CHECK(facts.at("no data") == "1");
    CHECK(facts.at("description") == "visibility");
    CHECK(facts.at("geotransform") == " 400000 30 0 4500000 0 -30");
    CHECK_THAT(facts.at("file's "), Contains("OBSERVERS=3\n"));
}

TEST_CASE("packed runs unpack to the same bytes, and take no more room than they may", "[tiff_file]") {
    std::mt19937 random(7);
    const auto check = [](const std::vector<std::uint8_t>& row) {
        std::vector<std::uint8_t> packed(most_packed(row.size()) + 1, 0xA5);
        const auto end = static_cast<std::size_t>(pack_bits(row.data(), row.size(), packed.data()) - packed.data());
        REQUIRE(end <= most_packed(row.size()));
        CHECK(packed[end] == 0xA5);  // and not a byte more
        // As the standard says it is read.
        std::vector<std::uint8_t> found;
        for (std::size_t i = 0; i < end;) {
            const int n = static_cast<std::int8_t>(packed[i++]);
            REQUIRE(n != -128);
            const std::size_t count = static_cast<std::size_t>(n < 0 ? 1 - n : n + 1);
            REQUIRE(i + (n < 0 ? 1 : count) <= end);
            for (std::size_t k = 0; k < count; ++k) found.push_back(packed[n < 0 ? i : i + k]);
            i += n < 0 ? 1 : count;
        }
        CHECK(found == row);
        return end;
    };
    for (const std::size_t n : {1U, 2U, 3U, 7U, 8U, 9U, 127U, 128U, 129U, 130U, 255U, 256U, 257U, 600U}) {
        CAPTURE(n);
        CHECK(check(std::vector<std::uint8_t>(n, 255)) <= 2 * ((n + 127) / 128));
        std::vector<std::uint8_t> row(n);
        for (std::size_t i = 0; i < n; ++i) row[i] = static_cast<std::uint8_t>(i * 7);
        check(row);
        for (int longest = 1; longest <= 300; longest = longest * 2 + 1)
            for (int again = 0; again < 20; ++again) {
                std::uniform_int_distribution<int> length(1, longest), value(0, 2);
                for (std::size_t i = 0; i < n;) {
                    const auto byte = static_cast<std::uint8_t>(value(random) * 100);
                    for (int k = length(random); k > 0 && i < n; --k) row[i++] = byte;
                }
                check(row);
            }
    }
}
