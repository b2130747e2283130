// The tile store: equal to its rasters post for post, its block map true, every damage named, and resumed to the same bytes.
#include <catch2/catch.hpp>

#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <random>
#include <span>
#include <sstream>
#include <thread>

#include "lib/engine.hpp"
#include "lib/error.hpp"
#include "tests/drawn_raster.hpp"
#include "tests/refusal.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/source_choice.hpp"
#include "tiles/store_check.hpp"
#include "tiles/tile_store.hpp"
#include "tools/options.hpp"

using namespace wedgescope;
using Catch::Matchers::Contains;
using wedgescope::test::draw;
using wedgescope::test::Drawing;
using wedgescope::test::Folder;
using wedgescope::test::refusal;

namespace {

namespace fs = std::filesystem;

const std::string data = WEDGESCOPE_TEST_DATA;
const GdalSession session(std::size_t{16} << 20, {});

TileStoreParams into(const std::string& output, const std::vector<std::string>& dems) {
    TileStoreParams params;
    params.dems = dems;
    params.output = output;
    params.memory_bytes = std::size_t{256} << 20;
    params.cache_bytes = std::size_t{16} << 20;
    params.threads = 2;
    params.most_as_it_is = 0;  // packed, as large ones are
    params.software = "test";
    return params;
}

DataBaseParams base(const std::string& dem) {
    DataBaseParams params;
    params.dem = dem;
    params.cache_bytes = std::size_t{4} << 20;
    return params;
}

/// The first band as GDAL gives it, in doubles.
struct Plain {
    int columns = 0, rows = 0;
    std::vector<double> values;
    std::string type;
    double no_data = 0, scale = 1, offset = 0;
    bool has_no_data = false;
    std::string unit;
    std::vector<double> g = std::vector<double>(6);
    explicit Plain(const std::string& path) {
        GDALAllRegister();
        GDALDataset* in = GDALDataset::Open(path.c_str());
        if (!in) throw std::runtime_error("cannot open " + path);
        GDALRasterBand* band = in->GetRasterBand(1);
        columns = in->GetRasterXSize();
        rows = in->GetRasterYSize();
        in->GetGeoTransform(g.data());
        int has = 0;
        no_data = band->GetNoDataValue(&has);
        has_no_data = has != 0;
        scale = band->GetScale();
        offset = band->GetOffset();
        unit = band->GetUnitType();
        type = GDALGetDataTypeName(band->GetRasterDataType());
        values.resize(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
        if (band->RasterIO(GF_Read, 0, 0, columns, rows, values.data(), columns, rows, GDT_Float64, 0, 0, nullptr) !=
            CE_None)
            throw std::runtime_error("cannot read " + path);
        GDALClose(in);
    }
    double at(std::int64_t c, std::int64_t r) const { return values[static_cast<std::size_t>(r * columns + c)]; }
};

bool same(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }
bool same(const std::vector<double>& a, const std::vector<double>& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](double x, double y) { return same(x, y); });
}
bool same(std::span<const float> a, std::span<const float> b) {
    return a.size() == b.size() && std::equal(a.begin(), a.end(), b.begin(), [](float x, float y) {
               return x == y || (std::isnan(x) && std::isnan(y));
           });
}

/// Heights of the whole data base through the engine's interface.
RawVector<float> heights(WedgeSource& source) {
    const DataBase& d = source.data_base();
    return source.load({{0, d.columns}, {0, d.rows}}, false).surface_m;
}

std::map<std::string, std::string> contents(const std::string& folder) {
    std::map<std::string, std::string> all;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
        if (!entry.is_regular_file()) continue;
        std::ifstream in(entry.path(), std::ios::binary);
        std::ostringstream bytes;
        bytes << in.rdbuf();
        all[fs::relative(entry.path(), folder).string()] = bytes.str();
    }
    return all;
}

/// Hills, with a void hole and a stripe of voids.
Drawing hills(int columns, int rows, unsigned seed = 1) {
    Drawing d;
    d.columns = columns;
    d.rows = rows;
    d.type = GDT_Int16;
    d.no_data = -32768;
    d.value = [=](int c, int r) {
        if ((c > columns / 2 && c < columns / 2 + 80 && r > rows / 3) || r == rows / 5) return -32768.0;
        return std::floor(300 * std::sin(0.02 * c + seed) + 200 * std::cos(0.05 * r) + (c * 7 + r * 13) % 11);
    };
    return d;
}

/// A DTED cell of one degree from its south-western corner on, 30" down the rows; returns its path.
std::string draw_dted(const Folder& folder, const std::string& name, int lon, int lat, int columns,
                      const std::function<double(int column, int row)>& value) {
    Drawing d;
    d.columns = columns;
    d.rows = 121;
    d.type = GDT_Int16;
    d.crs = "EPSG:4326";
    const double sx = 1.0 / (columns - 1), sy = 1.0 / 120;
    d.geotransform = {{lon - sx / 2, sx, 0, lat + 1 + sy / 2, 0, -sy}};
    d.value = value;
    draw(folder / "cell.tif", d);
    GDALDataset* in = GDALDataset::Open((folder / "cell.tif").c_str());
    GDALDataset* out = GetGDALDriverManager()->GetDriverByName("DTED")->CreateCopy((folder / name).c_str(), in, 0,
                                                                                   nullptr, nullptr, nullptr);
    REQUIRE(out);
    GDALClose(out);
    GDALClose(in);
    return folder / name;
}

/// `columns` x `rows` posts of a plane, the first `x`, `y` metres east and south of a corner, `dx`, `dy` apart.
std::string draw_plane(const Folder& folder, const std::string& name, int columns, int rows, double x, double y,
                       double dx, double dy) {
    Drawing d;
    d.columns = columns;
    d.rows = rows;
    d.geotransform = {{400000 + x - dx / 2, dx, 0, 4000000 - y + dy / 2, 0, -dy}};
    d.value = [=](int c, int r) { return 500 + 0.25 * (x + c * dx) - 0.125 * (y + r * dy); };
    draw(folder / name, d);
    return folder / name;
}

std::uint64_t voids(const std::string& store) { return open_direct_source(base(store))->extremes().void_posts; }

/// Bounds of a block straight from its definition.
BlockBounds brute(std::span<const float> z, std::span<const float> h, std::int64_t columns, std::int64_t rows,
                  bool cyclic, int level, std::int64_t c, std::int64_t r) {
    const std::int64_t edge = block_posts << level;
    BlockBounds b;
    std::int64_t voids = 0, posts = 0;
    for (std::int64_t y = r * edge; y <= (r + 1) * edge && y < rows; ++y)
        for (std::int64_t x = c * edge; x <= (c + 1) * edge && x < columns + cyclic; ++x) {
            const auto at = static_cast<std::size_t>(y * columns + x % columns);
            ++posts;
            if (!h.empty()) b.culture_m = std::max(b.culture_m, h[at]);
            if (std::isnan(z[at])) {
                ++voids;
                continue;
            }
            b.lowest_m = std::min(b.lowest_m, z[at]);
            b.highest_m = std::max(b.highest_m, z[at]);
        }
    b.voids = voids == 0 ? Voids::none : voids == posts ? Voids::all : Voids::some;
    return b;
}

std::int64_t wrong_blocks(const std::string& store, float scale, bool cyclic) {
    auto params = base(store);
    params.culture_height_scale = static_cast<double>(scale);
    const auto source = open_direct_source(params);
    const DataBase& d = source->data_base();
    const Chunk chunk = source->load({{0, d.columns}, {0, d.rows}}, false);
    std::vector<float> bare(chunk.surface_m.size());
    for (std::int64_t r = 0; r < d.rows; ++r)
        for (std::int64_t c = 0; c < d.columns; ++c)
            bare[static_cast<std::size_t>(r * d.columns + c)] = source->bare_terrain_m(c, r);
    BlockMap* map = source->block_map();
    REQUIRE(map);
    std::int64_t wrong = 0;
    for (int level = 0; level < map->levels(); ++level) {
        const Window all = blocks_of({{0, d.columns}, {0, d.rows}}, level);
        const BlockWindow found = map->read(level, all);
        for (std::int64_t r = 0; r < all.rows.end; ++r)
            for (std::int64_t c = 0; c < all.columns.end; ++c)
                wrong +=
                    !(found.at(c, r) == brute(bare, chunk.culture_height_m, d.columns, d.rows, cyclic, level, c, r));
    }
    const Window last = blocks_of({{0, d.columns}, {0, d.rows}}, map->levels() - 1);
    CHECK((last.columns.size() <= 64 && last.rows.size() <= 64));
    return wrong;
}

struct Outcome {
    int code = 0;
    std::size_t peak_bytes = 0;
    std::string err;
};

/// Runs the program; `kill_after_us` > 0: kill -9 then.
/// `most_bytes` > 0: no file may grow beyond.
Outcome run_program(const std::vector<std::string>& arguments, const std::string& log, int kill_after_us = 0,
                    std::uint64_t most_bytes = 0) {
    std::string program = WEDGESCOPE_PROGRAM;
    std::vector<std::string> copy = arguments;
    std::vector<char*> list{program.data()};
    for (auto& a : copy) list.push_back(a.data());
    list.push_back(nullptr);
    const pid_t child = ::fork();
    if (child == 0) {
        const int e = ::open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
        if (e < 0 || ::dup2(e, 2) < 0 || ::dup2(e, 1) < 0) ::_exit(99);
        if (const rlimit limit{most_bytes, most_bytes}; most_bytes > 0) ::setrlimit(RLIMIT_FSIZE, &limit);
        ::execv(program.c_str(), list.data());
        ::_exit(98);
    }
    if (kill_after_us > 0) {
        std::this_thread::sleep_for(std::chrono::microseconds(kill_after_us));
        ::kill(child, SIGKILL);
    }
    int status = 0;
    rusage usage{};
    ::wait4(child, &status, 0, &usage);
    Outcome out;
    out.code = WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
    out.peak_bytes = static_cast<std::size_t>(usage.ru_maxrss) * 1024;
    std::ifstream in(log);
    std::ostringstream words;
    words << in.rdbuf();
    out.err = words.str();
    return out;
}

}  // namespace

TEST_CASE("a store holds its rasters post for post, for any GDAL program", "[store]") {
    const Folder folder;
    const std::string store = folder / "store";
    auto params = into(store, {data + "/olympic_coast_dem.tif"});
    params.culture = data + "/olympic_coast_dem.tif";
    params.culture_height = folder / "height.tif";
    Drawing height;
    height.columns = 30;
    height.rows = 20;
    height.crs = "EPSG:4326";
    const Plain dem(params.dems[0]);
    height.geotransform = {{dem.g[0], 0.07, 0, dem.g[3], 0, -0.05}};
    height.value = [](int c, int r) { return 0.25 * c + r; };
    draw(params.culture_height, height);
    const TileStoreSummary summary = write_tile_store(params);
    CHECK(summary.layers.size() == 3);
    CHECK(summary.disagreements == 0);
    CHECK(summary.note.empty());

    for (const auto& [file, vrt] : {std::pair(params.dems[0], "dem.vrt"), std::pair(params.culture, "culture.vrt"),
                                    std::pair(params.culture_height, "culture_height.vrt")}) {
        INFO(vrt);
        const Plain raw(file), stored(store + "/" + vrt);
        CHECK(raw.columns == stored.columns);
        CHECK(raw.rows == stored.rows);
        CHECK(raw.type == stored.type);
        CHECK(raw.g == stored.g);
        CHECK(raw.has_no_data == stored.has_no_data);
        if (raw.has_no_data) CHECK(same(raw.no_data, stored.no_data));
        CHECK(same(raw.values, stored.values));
    }
    // Overviews that programs use by themselves: half the size and less.
    GDALDataset* sheet = GDALDataset::Open((store + "/dem/c0_r0.tif").c_str());
    REQUIRE(sheet);
    CHECK(sheet->GetRasterBand(1)->GetOverviewCount() == 4);
    CHECK(sheet->GetRasterBand(1)->GetOverview(0)->GetXSize() == 1801);
    GDALClose(sheet);
    CHECK(fs::exists(store + ".part") == false);
    CHECK(verify_store(store, nullptr, {}).damage.empty());
}

TEST_CASE("an overview keeps every second post of heights, and of 2 x 2 codes the most frequent", "[store]") {
    const Folder folder;
    const Drawing d = hills(300, 131);
    draw(folder / "dem.tif", d);
    Drawing codes = d;
    codes.value = [](int c, int r) { return (c / 3 + r / 2) % 5; };
    draw(folder / "codes.tif", codes);
    auto params = into(folder / "store", {folder / "dem.tif"});
    params.culture = folder / "codes.tif";
    params.tile_posts = 64;
    write_tile_store(params);
    for (const char* layer : {"dem", "culture"}) {
        GDALDataset* sheet = GDALDataset::Open((folder / "store/" + layer + "/c0_r0.tif").c_str());
        REQUIRE(sheet);
        GDALRasterBand* band = sheet->GetRasterBand(1);
        REQUIRE(band->GetOverviewCount() == 3);
        int wide = 300, high = 131;
        std::vector<int> fine(300 * 131);
        REQUIRE(band->RasterIO(GF_Read, 0, 0, wide, high, fine.data(), wide, high, GDT_Int32, 0, 0, nullptr) ==
                CE_None);
        for (int k = 0; k < 3; ++k) {
            const int w = (wide + 1) / 2, h = (high + 1) / 2;
            std::vector<int> coarse(static_cast<std::size_t>(w * h));
            GDALRasterBand* overview = band->GetOverview(k);
            REQUIRE(overview->GetXSize() == w);
            REQUIRE(overview->GetYSize() == h);
            REQUIRE(overview->RasterIO(GF_Read, 0, 0, w, h, coarse.data(), w, h, GDT_Int32, 0, 0, nullptr) == CE_None);
            int wrong = 0;
            for (int r = 0; r < h; ++r)
                for (int c = 0; c < w; ++c) {
                    std::vector<int> valid;
                    for (int y = 2 * r; y < std::min(2 * r + 2, high); ++y)
                        for (int x = 2 * c; x < std::min(2 * c + 2, wide); ++x)
                            if (const int v = fine[static_cast<std::size_t>(y * wide + x)]; v != -32768)
                                valid.push_back(v);
                    int want = -32768;
                    if (!valid.empty() && std::string(layer) == "dem") {
                        want = fine[static_cast<std::size_t>(2 * r * wide + 2 * c)];
                    } else if (!valid.empty()) {
                        std::size_t votes = 0;
                        for (const int v : valid)
                            if (const auto n = static_cast<std::size_t>(std::count(valid.begin(), valid.end(), v));
                                n > votes) {
                                votes = n;
                                want = v;
                            }
                    }
                    wrong += coarse[static_cast<std::size_t>(r * w + c)] != want;
                }
            CHECK(wrong == 0);
            wide = w;
            high = h;
            fine = coarse;
        }
        GDALClose(sheet);
    }
}

TEST_CASE("heights read from a store are those of the raster, whatever type, scale, unit and mask it has", "[store]") {
    const Folder folder;
    std::vector<Drawing> drawings;
    Drawing d = hills(150, 90);
    drawings.push_back(d);
    d.geotransform = {{0, 5, 0, 100, 0, 5}};  // south-up
    drawings.push_back(d);
    d.geotransform.reset();
    d.crs.clear();
    drawings.push_back(d);
    d = hills(150, 90);
    d.scale = 0.1;
    d.offset = 7;
    d.unit = "ft";
    drawings.push_back(d);
    for (const GDALDataType type : {GDT_Byte, GDT_UInt16, GDT_Int32, GDT_UInt32, GDT_Float32, GDT_Float64}) {
        Drawing t;
        t.columns = 150;
        t.rows = 90;
        t.type = type;
        t.value = [](int c, int r) { return (c * 3 + r) % 200; };
        drawings.push_back(t);
        t.masked = [](int c, int r) { return (c + r) % 9 == 0; };
        if (type != GDT_UInt32) drawings.push_back(t);
        t.masked = {};
        t.no_data = type == GDT_Float64 ? -1.7976931348623157e308 : 17;
        drawings.push_back(t);
    }
    d.type = GDT_Float64;
    d.value = [](int c, int r) { return c == r ? std::nan("") : 0.1 * c - r / 3.0; };
    d.no_data.reset();
    drawings.push_back(d);
    d.type = GDT_Byte;
    d.creation = {"PIXELTYPE=SIGNEDBYTE"};
    d.value = [](int c, int) { return c - 75; };
    drawings.push_back(d);
    for (std::size_t i = 0; i < drawings.size(); ++i) {
        INFO("drawing " << i);
        const std::string file = folder / ("dem" + std::to_string(i) + ".tif"),
                          store = folder / ("store" + std::to_string(i));
        draw(file, drawings[i]);
        auto params = into(store, {file});
        params.tile_posts = 64;
        write_tile_store(params);
        const auto raw = open_direct_source(base(file)), stored = open_direct_source(base(store));
        CHECK(same(heights(*raw), heights(*stored)));
        const DataBase &a = raw->data_base(), &b = stored->data_base();
        CHECK(a.origin_x == b.origin_x);
        CHECK(a.origin_y == b.origin_y);
        CHECK(a.step_x == b.step_x);
        CHECK(a.step_y == b.step_y);
        CHECK(a.metres_per_unit == b.metres_per_unit);
        CHECK(a.has_crs == b.has_crs);
        const Extremes x = raw->extremes(), y = stored->extremes();
        CHECK(x.lowest_m == y.lowest_m);
        CHECK(x.highest_m == y.highest_m);
        CHECK(x.void_posts == y.void_posts);
    }
}

TEST_CASE("DTED cells of unequal posting become one grid of the finest, and edges that disagree are counted",
          "[store]") {
    const Folder folder;
    GDALAllRegister();
    // Three cells round 50 degrees north: 3" of longitude below, 6" above. A plane has no error under bilinear.
    const auto plane = [](double lon, double lat) { return std::lround(1000 + 1200 * (lon - 10) + 600 * (lat - 50)); };
    const auto cell = [&](int lon, int lat, int columns, const std::string& name, int wrong) {
        return draw_dted(folder, name, lon, lat, columns, [=](int c, int r) {
            // The western edge of the second cell is off for some posts.
            const int off = c == 0 && r < wrong ? 3 + r : 0;
            return static_cast<double>(plane(lon + c * (1.0 / (columns - 1)), lat + 1 - r * (1.0 / 120)) + off);
        });
    };
    const std::string a = cell(10, 49, 121, "a.dt0", 0), b = cell(11, 49, 121, "b.dt0", 5),
                      c = cell(10, 50, 61, "c.dt0", 0);
    const TileStoreSummary summary = write_tile_store(into(folder / "store", {a, b, c}));
    CHECK(summary.disagreements == 5);
    CHECK(summary.largest_m == 7);
    CHECK_THAT(summary.largest_where,
               Contains("a.dt0' (kept)") && Contains("b.dt0") && Contains("column 120, row 124"));
    CHECK_THAT(summary.note, Contains("1 of 3 rasters resampled"));
    const auto source = open_direct_source(base(folder / "store"));
    const DataBase& d = source->data_base();
    CHECK(d.columns == 241);
    CHECK(d.rows == 241);
    CHECK(d.origin_x == Approx(10).margin(1e-9));
    CHECK(d.origin_y == Approx(51).margin(1e-9));
    const RawVector<float> z = heights(*source);
    std::int64_t wrong = 0, voids = 0;
    for (int r = 0; r < 241; ++r)
        for (int col = 0; col < 241; ++col) {
            const float h = z[static_cast<std::size_t>(r * 241 + col)];
            if (r < 120 && col > 120) {  // no cell there
                voids += std::isnan(h);
                continue;
            }
            wrong +=
                std::fabs(static_cast<double>(h) - static_cast<double>(plane(10 + col / 120.0, 51 - r / 120.0))) > 0.51;
        }
    CHECK(wrong == 0);  // half a metre: cells hold whole metres
    CHECK(voids == 120 * 120);

    // The other way round the second cell's edge stays.
    write_tile_store(into(folder / "other", {b, a, c}));
    const auto other = open_direct_source(base(folder / "other"));
    CHECK(other->bare_terrain_m(120, 124) == source->bare_terrain_m(120, 124) + 7);
}

TEST_CASE("cells of unequal posting that disagree on their shared row are reported", "[store]") {
    const Folder folder;
    GDALAllRegister();
    // A plane that bilinear leaves as it is: 10 m from post to post of 30", 5 m down the rows. South of 50 degrees every
    // 30", north of it every 60" along the rows.
    const auto cell = [&](int lat, int columns, const std::string& name, const std::map<int, int>& off) {
        return draw_dted(folder, name, 10, lat, columns, [&](int c, int r) {
            const int wrong = r == 0 && off.contains(c) ? off.at(c) : 0;
            return 1000.0 + 10 * c * 120 / (columns - 1) + 5 * (r + (50 - lat) * 120) + wrong;
        });
    };
    // Posts 10, 20 and 22 are the northern cell's too, 11, 13 and 15 lie between two of its posts, which are 20 m apart.
    const std::string south = cell(49, 121, "south.dt0", {{10, 1}, {11, 20}, {13, 60}, {15, 50}, {20, -40}, {22, 0}}),
                      north = cell(50, 61, "north.dt0", {});
    for (const bool south_first : {true, false}) {
        const std::vector<std::string> given = south_first ? std::vector{south, north} : std::vector{north, south};
        auto params = into(folder / "store", given);
        params.overwrite = true;
        const TileStoreSummary summary = write_tile_store(params);
        CHECK(summary.disagreements == 3);  // 10, 13, 20
        CHECK(summary.interpolated == 1);
        CHECK(summary.largest_m == 60);
        CHECK_THAT(summary.largest_where,
                   Contains(fs::path(given[0]).filename().string() + "' (kept)") &&
                       Contains(fs::path(given[1]).filename().string() + "' at column 13, row 120"));
        const auto source = open_direct_source(base(folder / "store"));
        CHECK(source->bare_terrain_m(13, 120) == (south_first ? 1790.0F : 1730.0F));
        CHECK(source->bare_terrain_m(20, 120) == (south_first ? 1760.0F : 1800.0F));
    }
}

TEST_CASE("no void lies between sheets of unequal posting whose pixels meet without a common post",
          "[store][threads]") {
    const Folder folder;
    // As Copernicus cells north and south of 50 degrees: two of 10 m, two of 15 m along the rows; the seam between these
    // is beyond the first sheet of the store.
    constexpr int wide = 4098, high = 12;
    std::vector<std::string> given;
    for (const int cell : {0, 1}) {
        const double x = 10.0 * wide * cell;
        given.push_back(draw_plane(folder, text("north", cell), wide * 2 / 3, high, x, 0, 15, 10));
        given.push_back(draw_plane(folder, text("south", cell), wide, high, x, 10.0 * high, 10, 10));
    }
    auto params = into(folder / "store", given);
    const TileStoreSummary summary = write_tile_store(params);
    CHECK(voids(folder / "store") == 0);
    CHECK(summary.disagreements == 0);
    CHECK(summary.note == "2 of 4 rasters resampled bilinearly to steps of 10, -10: stored as Float32 metres");
    const Plain plain(folder / "store/dem.vrt");
    REQUIRE(plain.columns == 2 * wide);
    REQUIRE(plain.rows == 2 * high);
    std::int64_t wrong = 0;
    for (int r = 0; r < 2 * high; ++r)
        for (int c = 0; c < 2 * wide; ++c) {
            // Beyond the last northern post, half a column before, there is none to go to.
            const double x = r < high && c == 2 * wide - 1 ? c - 0.5 : c;
            wrong += !(std::fabs(plain.at(c, r) - (500 + 2.5 * x - 1.25 * r)) < 0.002);  // float at 20 km
        }
    CHECK(wrong == 0);
    CHECK(wrong_blocks(folder / "store", 1, false) == 0);

    const auto whole = contents(folder / "store");
    params.output = folder / "part";
    params.threads = 1;
    Stop stop;
    params.stop = &stop;
    params.progress = [&](double fraction) {
        if (fraction > 0.2) stop.request(SIGTERM);
    };
    CHECK_THROWS_AS(write_tile_store(params), Interrupted);
    params.stop = nullptr;
    params.progress = {};
    params.resume = true;
    CHECK(write_tile_store(params).layers[0].reused == 1);
    CHECK(contents(folder / "part") == whole);
}

TEST_CASE("pixels of 15 m and 30 m that meet edge to edge leave no void, a gap between them does", "[store]") {
    const Folder folder;
    const std::string left = draw_plane(folder, "left.tif", 40, 20, 7.5, 7.5, 15, 15);
    const auto right = [&](double gap_m) { return draw_plane(folder, "right.tif", 20, 10, 615 + gap_m, 15, 30, 30); };
    const auto tiled = [&](const std::vector<std::string>& given) {
        auto params = into(folder / "store", given);
        params.overwrite = true;
        return write_tile_store(params);
    };
    tiled({right(0), left});
    const Plain turned(folder / "store/dem.vrt");
    const TileStoreSummary whole = tiled({left, right(0)});
    CHECK(voids(folder / "store") == 0);
    CHECK(whole.note == "1 of 2 rasters resampled bilinearly to steps of 15, -15: stored as Float32 metres");
    const Plain plain(folder / "store/dem.vrt");
    CHECK(same(plain.values, turned.values));
    REQUIRE((plain.columns == 79 && plain.rows == 20));
    for (int r = 0; r < 20; ++r)
        for (int c = 0; c < 79; ++c) {
            // The first and last rows take the nearest row of 30 m, in the column at the joint by a third of a way.
            const double y = r == 0 ? 15.0 : r == 19 ? 285.0 : 7.5 + 15 * r, own_y = 7.5 + 15 * r;
            const double height_y = c < 40 ? own_y : c == 40 ? (2 * y + own_y) / 3 : y;
            CAPTURE(c, r);
            REQUIRE(plain.at(c, r) == Approx(500 + 0.25 * (7.5 + 15 * c) - 0.125 * height_y).margin(1e-4));
        }

    // The posts at 607.5 m; those at 607.5, 622.5 and 637.5 m.
    const TileStoreSummary narrow = tiled({left, right(20)});
    CHECK(voids(folder / "store") == 20);
    CHECK_THAT(narrow.note, Contains("; rasters leave 1 gap narrower than two posts") && Contains("left.tif' and '"));
    CHECK(tiled({left, right(40)}).note == whole.note);
    CHECK(voids(folder / "store") == 3 * 20);
}

TEST_CASE("only pixels that are resampled and share no line reach beyond their posts", "[store]") {
    const Folder folder;
    const auto tiled = [&](const std::vector<std::string>& given) {
        auto params = into(folder / "store", given);
        params.overwrite = true;
        return write_tile_store(params);
    };
    // Cells of 10 m and, north of them, of 30 m and a row in common: what lies east of that stays void.
    const std::string west = draw_plane(folder, "west.tif", 31, 11, 0, 100, 10, 10),
                      east = draw_plane(folder, "east.tif", 31, 11, 300, 100, 10, 10),
                      north = draw_plane(folder, "north.tif", 11, 11, 0, 0, 30, 10);
    tiled({west, east, north});
    CHECK(voids(folder / "store") == 30 * 10);
    // A column and a row of voids between pixels of one posting.
    const std::string aside = draw_plane(folder, "aside.tif", 31, 11, 320, 100, 10, 10),
                      below = draw_plane(folder, "below.tif", 31, 11, 0, 220, 10, 10);
    const TileStoreSummary gaps = tiled({west, aside, below});
    CHECK(voids(folder / "store") == 11 + 63 + 32 * 11);
    CHECK_THAT(gaps.note, Contains("rasters leave 2 gaps narrower than two posts") && Contains("west.tif' and '") &&
                              Contains("aside.tif'"));
    CHECK(tiled({west, east}).note.empty());
    // A raster of one posting over the gap.
    const std::string over = draw_plane(folder, "over.tif", 5, 11, 290, 100, 10, 10);
    CHECK(tiled({west, aside, over}).note.empty());
}

TEST_CASE("rasters that overlap at unlike posting or between each other's posts disagree as far as they can be told",
          "[store]") {
    const Folder folder;
    // Fine: 60 x 50 posts of 10 m on a plane of 2 m a column and 1 m a row.
    const auto fine = [](double x, double y) { return 500 + 2 * x + y; };
    Drawing d;
    d.columns = 60;
    d.rows = 50;
    d.value = [&](int c, int r) { return c == 50 && r == 21 ? NAN : fine(c, r); };
    draw(folder / "fine.tif", d);
    // Another of the same plane, raised; its first post is the fine raster's (40, 20).
    const auto other = [&](double posting, double shift, double raised, double roughness) {
        Drawing o;
        o.columns = o.rows = static_cast<int>(60 / posting) + 1;
        o.geotransform = {{1000 + 10 * (40.5 + shift - posting / 2), 10 * posting, 0,
                           2000 - 10 * (20.5 + shift - posting / 2), 0, -10 * posting}};
        o.value = [=](int c, int r) {
            return fine(40 + shift + c * posting, 20 + shift + r * posting) + raised + roughness * ((c + r) % 2);
        };
        draw(folder / "other.tif", o);
    };
    const auto tiled = [&](const std::string& first, const std::string& second) {
        auto params = into(folder / "store", {folder / first, folder / second});
        params.overwrite = true;
        return write_tile_store(params);
    };
    const auto disagreements = [&] {
        const TileStoreSummary summary = tiled("fine.tif", "other.tif"), turned = tiled("other.tif", "fine.tif");
        CHECK(summary.disagreements == turned.disagreements);
        CHECK(summary.largest_m == turned.largest_m);
        return summary;
    };
    // Columns 40 to 59, rows 20 to 49 are in both: 600 posts, of which one is void. Of half the posting 10 x 15 coincide.
    other(2, 0, 0, 0);
    CHECK(disagreements().disagreements == 0);
    other(2, 0, 100, 0);
    CHECK(disagreements().disagreements == 599);
    CHECK(disagreements().largest_m == 100);
    CHECK_THAT(disagreements().largest_where, Contains("column 40, row 20"));
    other(2, 0, 20, 0);  // between posts no more than may be
    CHECK(disagreements().disagreements == 150);
    CHECK(disagreements().interpolated == 0);
    // Half a post aside, on the grid of the first: the other's posts lie between its own, columns 41 to 59, rows 21 to 49.
    // The void takes one post from the fine raster, and four where that is interpolated.
    other(1, 0.5, 0, 0);
    CHECK(tiled("fine.tif", "other.tif").disagreements == 0);
    CHECK(tiled("other.tif", "fine.tif").disagreements == 0);
    other(1, 0.5, 100, 0);
    const TileStoreSummary aside = tiled("fine.tif", "other.tif");
    CHECK_THAT(aside.note, Contains("1 of 2 rasters resampled"));
    CHECK(aside.disagreements == 19 * 29 - 1);
    CHECK(aside.interpolated == aside.disagreements);
    CHECK(aside.largest_m == 100);
    CHECK_THAT(aside.largest_where, Contains("column 41, row 21"));
    CHECK(tiled("other.tif", "fine.tif").disagreements == 19 * 29 - 4);
    // A relief of 3 m between four neighbours and 30 m more may be.
    other(1, 0.5, 33, 0);
    CHECK(tiled("fine.tif", "other.tif").disagreements == 0);
    other(1, 0.5, 33.125, 0);
    CHECK(tiled("fine.tif", "other.tif").disagreements == 19 * 29 - 1);
    // Posts up and down by 200 m tell nothing of the ground between them.
    other(1, 0.5, -100, 200);
    CHECK(tiled("fine.tif", "other.tif").disagreements == 0);
    // Three times the posting and a little more, so that posts drift apart by hundredths: they are the same all the same,
    // and compared as they are.
    Drawing o;
    o.columns = o.rows = 20;
    o.geotransform = {{1000 + 10 * (40.5 - 1.5), 30.01, 0, 2000 - 10 * (20.5 - 1.5), 0, -30.01}};
    o.value = [&](int c, int r) { return fine(40 + 3 * c, 20 + 3 * r) + 1; };
    draw(folder / "other.tif", o);
    CHECK(disagreements().disagreements == 7 * 10);
    CHECK(disagreements().largest_m == 1);
}

TEST_CASE("a post where several rasters disagree counts once, with the largest difference", "[store]") {
    const Folder folder;
    std::vector<std::string> paths;
    for (const double height : {100.0, 103.0, 90.0, 100.0}) {
        Drawing d;
        d.columns = 40;
        d.rows = 30;
        d.value = [=](int c, int r) { return c == 7 && r == 9 ? height : 100.0; };
        paths.push_back(folder / (std::to_string(paths.size()) + ".tif"));
        draw(paths.back(), d);
    }
    Drawing coarse;  // of every second post, 8 m lower
    coarse.columns = 20;
    coarse.rows = 15;
    coarse.geotransform = {{995, 20, 0, 2005, 0, -20}};
    coarse.value = [](int, int) { return 92.0; };
    const TileStoreSummary fine = write_tile_store(into(folder / "fine", paths));
    CHECK(fine.disagreements == 1);
    CHECK(fine.largest_m == 10);
    CHECK_THAT(fine.largest_where, Contains("0.tif' (kept) and '") && Contains("2.tif' at column 7, row 9"));
    draw(folder / "coarse.tif", coarse);
    paths.push_back(folder / "coarse.tif");
    const TileStoreSummary all = write_tile_store(into(folder / "all", paths));
    CHECK(all.disagreements == 1 + 20 * 15);
    CHECK(all.interpolated == 0);
    CHECK(all.largest_m == 10);
}

TEST_CASE("what disagrees does not depend on threads, memory, tiles or the rasters' order", "[store][threads]") {
    const Folder folder;
    // Rough ground over three sheets, and a coarser raster of its own roughness over the seams between them.
    const auto rough = [](std::int64_t c, std::int64_t r, unsigned seed) {
        std::uint64_t x = static_cast<std::uint64_t>(c * 7919 + r * 104729 + 1) * (2654435761U + 2 * seed);
        x ^= x >> 29;
        return static_cast<double>(x * 0x9E3779B97F4A7C15U >> 58);  // 0 to 63
    };
    constexpr int wide = 2 * 4096 + 100, high = 90, coarse_wide = 2200, coarse_high = 40, first = 3990, top = 5;
    const auto fine = [&](int c, int r) { return 1000 + rough(c, r, 1); };
    const auto coarse = [&](int c, int r) { return 1040 + rough(c, r, 2); };
    Drawing d;
    d.columns = wide;
    d.rows = high;
    d.type = GDT_Int16;
    d.no_data = -32768;
    d.value = [&](int c, int r) { return r == 40 ? -32768.0 : fine(c, r); };
    draw(folder / "fine.tif", d);
    Drawing o = d;
    o.columns = coarse_wide;
    o.rows = coarse_high;
    o.geotransform = {{1000 + 10.0 * (first - 0.5), 20, 0, 2000 - 10.0 * (top - 0.5), 0, -20}};
    o.value = [&](int c, int r) { return c == 100 ? -32768.0 : coarse(c, r); };
    draw(folder / "coarse.tif", o);

    // As the guide has it, post by post.
    std::uint64_t posts = 0, between = 0;
    double largest = 0;
    for (int r = 0; r < high; ++r)
        for (int c = 0; c < wide; ++c) {
            const int x = c - first, y = r - top;
            if (r == 40 || x < 0 || y < 0 || x > 2 * (coarse_wide - 1) || y > 2 * (coarse_high - 1)) continue;
            std::vector<double> around;
            for (int v = y / 2; v <= (y + 1) / 2; ++v)
                for (int u = x / 2; u <= (x + 1) / 2; ++u) around.push_back(u == 100 ? NAN : coarse(u, v));
            double mean = 0;
            for (const double z : around) mean += z / static_cast<double>(around.size());
            if (std::isnan(mean)) continue;
            const double apart = std::fabs(mean - fine(c, r));
            const auto [low, top_z] = std::minmax_element(around.begin(), around.end());
            if (around.size() == 1 ? apart == 0 : apart <= *top_z - *low + 30) continue;
            ++posts;
            between += around.size() > 1;
            largest = std::max(largest, apart);
        }
    REQUIRE(posts > 100000);
    REQUIRE(between > 1000);
    for (const std::int64_t tile : {64, 256})
        for (const int threads : {1, 2})
            for (const bool fine_first : {true, false}) {
                CAPTURE(tile, threads, fine_first);
                auto params = into(folder / "store", {folder / (fine_first ? "fine.tif" : "coarse.tif"),
                                                      folder / (fine_first ? "coarse.tif" : "fine.tif")});
                params.overwrite = true;
                params.tile_posts = tile;
                params.threads = threads;
                params.memory_bytes = std::size_t{threads == 1 ? 64U : 512U} << 20;
                const TileStoreSummary summary = write_tile_store(params);
                CHECK(summary.disagreements == posts);
                CHECK(summary.interpolated == between);
                CHECK(static_cast<double>(summary.largest_m) == largest);
            }
}

TEST_CASE("HGT cells and a GeoTIFF across the antimeridian lie side by side", "[store]") {
    const Folder folder;
    GDALAllRegister();
    const auto height = [](double lon, double lat) { return std::lround(40 * std::fmod(lon + 360, 360.0) + 10 * lat); };
    Drawing d;
    d.columns = d.rows = 1201;
    d.type = GDT_Int16;
    d.crs = "EPSG:4326";
    d.no_data = -32768;
    const double s = 1.0 / 1200;
    d.geotransform = {{179 - s / 2, s, 0, 1 + s / 2, 0, -s}};
    d.value = [&](int c, int r) {
        return r > 1000 && c < 100 ? -32768.0 : static_cast<double>(height(179 + c * s, 1 - r * s));
    };
    draw(folder / "west.tif", d);
    GDALDataset* in = GDALDataset::Open((folder / "west.tif").c_str());
    GDALDataset* out = GetGDALDriverManager()->GetDriverByName("SRTMHGT")->CreateCopy((folder / "N00E179.hgt").c_str(),
                                                                                      in, 0, nullptr, nullptr, nullptr);
    REQUIRE(out);
    GDALClose(out);
    GDALClose(in);
    d.geotransform = {{-180 - s / 2, s, 0, 1 + s / 2, 0, -s}};
    d.no_data = -9999;
    d.columns = 301;
    d.value = [&](int c, int r) { return static_cast<double>(height(180 + c * s, 1 - r * s)); };
    draw(folder / "east.tif", d);
    const TileStoreSummary summary =
        write_tile_store(into(folder / "store", {folder / "N00E179.hgt", folder / "east.tif"}));
    CHECK(summary.disagreements == 0);
    CHECK(summary.layers[0].type == "Int16");
    const auto source = open_direct_source(base(folder / "store"));
    CHECK(source->data_base().columns == 1501);
    CHECK(source->data_base().rows == 1201);
    CHECK(source->data_base().locate(0.5, -179.9).column == Approx(1320).margin(1e-6));
    const RawVector<float> z = heights(*source);
    std::int64_t wrong = 0;
    for (int r = 0; r < 1201; ++r)
        for (int c = 0; c < 1501; ++c) {
            const float h = z[static_cast<std::size_t>(r * 1501 + c)];
            wrong += r > 1000 && c < 100 ? !std::isnan(h) : h != static_cast<float>(height(179 + c * s, 1 - r * s));
        }
    CHECK(wrong == 0);
}

TEST_CASE("rasters in different CRS are refused with the way out", "[store]") {
    const Folder folder;
    draw(folder / "a.tif", hills(40, 40));
    Drawing d = hills(40, 40);
    d.crs = "EPSG:32612";
    draw(folder / "b.tif", d);
    CHECK_THAT(refusal([&] {
                   write_tile_store(into(folder / "store", {folder / "a.tif", folder / "b.tif"}));
               }),
               Contains("b.tif") && Contains("EPSG:32612") && Contains("gdalwarp -t_srs EPSG:32611 -r bilinear") &&
                   !Contains(" -te "));
    auto params = into(folder / "store", {folder / "a.tif"});
    params.culture = folder / "b.tif";
    CHECK_THAT(refusal([&] { write_tile_store(params); }), Contains("culture") && Contains("gdalwarp"));
    CHECK(folder.names() == std::vector<std::string>{"a.tif", "b.tif"});
}

TEST_CASE("bounds of blocks are those of their posts at every level", "[store][threads]") {
    const Folder folder;
    // Wide enough for two levels and pages; heights on a coarser grid; a block of nothing but voids.
    Drawing d = hills(2500, 150);
    const auto plain = d.value;
    d.value = [=](int c, int r) { return c >= 640 && c < 720 ? -32768 : plain(c, r); };
    draw(folder / "dem.tif", d);
    Drawing h;
    h.columns = 400;
    h.rows = 30;
    h.geotransform = {{1000, 63, 0, 1990, 0, -49}};
    h.value = [](int c, int r) { return (c * r) % 17; };
    draw(folder / "height.tif", h);
    auto params = into(folder / "store", {folder / "dem.tif"});
    params.culture_height = folder / "height.tif";
    params.tile_posts = 128;
    write_tile_store(params);
    CHECK(wrong_blocks(folder / "store", 1, false) == 0);
    CHECK(wrong_blocks(folder / "store", 0.1F, false) == 0);
    auto read = base(folder / "store");
    for (const double scale : {0.0, 0.1, 1.0, 25.0}) {
        read.culture_height_scale = scale;
        auto raw = base(folder / "dem.tif");
        raw.culture_height = folder / "height.tif";
        raw.culture_height_scale = scale;
        const Extremes a = open_direct_source(raw)->extremes(), b = open_direct_source(read)->extremes();
        CHECK(a.lowest_m == b.lowest_m);
        CHECK(a.highest_m == b.highest_m);
        CHECK(a.void_posts == b.void_posts);
    }

    for (const int extra : {0, 1}) {
        Drawing world;
        world.columns = 360 + extra;
        world.rows = 100;
        world.crs = "EPSG:4326";
        world.geotransform = {{-180.5, 1, 0, 50, 0, -1}};
        world.value = [](int c, int r) { return c % 360 == 0 ? 5000 + r : c % 50; };
        draw(folder / "world.tif", world);
        const std::string store = folder / ("world" + std::to_string(extra));
        write_tile_store(into(store, {folder / "world.tif"}));
        CHECK(wrong_blocks(store, 1, extra == 0) == 0);
        CHECK(open_direct_source(base(store))->extremes().highest_m == 5099);
    }
}

TEST_CASE("a store keeps what one unit of its culture heights is; scenes over it take that unless they are told",
          "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(300, 200));
    Drawing h;
    h.columns = 300;
    h.rows = 200;
    h.value = [](int c, int r) { return (c * r) % 170; };
    draw(folder / "height.tif", h);
    auto params = into(folder / "metres", {folder / "dem.tif"});
    params.culture_height = folder / "height.tif";
    write_tile_store(params);
    CHECK_FALSE(store_height_scale(folder / "metres").has_value());
    CHECK_FALSE(store_height_scale(folder / "dem.tif").has_value());
    params.culture_height_scale = 0.1;
    params.output = folder / "tenths";
    write_tile_store(params);
    CHECK(store_height_scale(folder / "tenths") == 0.1);
    CHECK(describe_store(folder / "tenths").culture_height_scale == 0.1);
    CHECK(verify_store(folder / "tenths", nullptr, {}).damage.empty());
    // Values as they were, metres for others.
    const Plain metres((folder / "metres") + "/culture_height.vrt"),
        tenths((folder / "tenths") + "/culture_height.vrt");
    CHECK(same(metres.values, tenths.values));
    CHECK(metres.scale == 1);
    CHECK(tenths.scale == 0.1);
    // Not to be gone on with as if nothing was.
    CHECK(contents(folder / "metres")["plan.json"] != contents(folder / "tenths")["plan.json"]);

    const auto scale = [&](const std::string& dem, const std::vector<std::string>& more) {
        std::vector<std::string> words{"--dem", dem, "--latlon", "1,2", "--altitude-msl", "2km"};
        words.insert(words.end(), more.begin(), more.end());
        return parse_arguments(command_simulate, words).culture_height_scale;
    };
    CHECK(scale(folder / "tenths", {}) == 0.1);
    CHECK(scale(folder / "tenths", {"--culture-height-scale", "1"}) == 1);
    CHECK(scale(folder / "tenths", {"--culture-height", folder / "height.tif"}) == 1);  // another's
    CHECK(scale(folder / "metres", {}) == 1);
    CHECK(parse_arguments(command_coverage, {folder / "tenths", folder / "mask.tif"}).culture_height_scale == 0.1);
    CHECK(parse_arguments(command_tile, {"--around", "1,2", folder / "tenths"}).culture_height_scale == 0.1);
}

TEST_CASE("of a chunk what is not needed has its block's fill height, all else its own, rows as lines or columns",
          "[store]") {
    const Folder folder;
    Drawing d = hills(700, 500);
    draw(folder / "dem.tif", d);
    d.creation = {"TILED=YES", "BLOCKXSIZE=128", "BLOCKYSIZE=64", "COMPRESS=DEFLATE"};
    draw(folder / "packed.tif", d);
    auto params = into(folder / "store", {folder / "dem.tif"});
    params.tile_posts = 128;
    params.creation = {"COMPRESS=NONE"};
    write_tile_store(params);
    // Tiles of the first two stay unpacked; of the file no more pieces are read than need be; with so little memory of none.
    auto from = base(folder / GENERATE(as<std::string>(), "store", "packed.tif", "dem.tif"));
    if (GENERATE(false, true)) from.cache_bytes = std::size_t{1} << 16;
    CAPTURE(from.dem, from.cache_bytes);
    const auto source = open_direct_source(from);
    std::mt19937 random(8);
    const auto upto = [&](std::int64_t most) {
        return static_cast<std::int64_t>(random() % static_cast<unsigned>(most));
    };
    constexpr std::int64_t margin = ChunkRequest::margin;
    std::int64_t wrong = 0, filled = 0, kept = 0;
    for (int trial = 0; trial < 60; ++trial) {
        ChunkRequest request;
        const std::int64_t c0 = upto(500), r0 = upto(400);
        request.window = {{c0, c0 + 1 + upto(700 - c0)}, {r0, r0 + 1 + upto(500 - r0)}};
        request.blocks = blocks_of(request.window);
        request.lines_are_columns = trial % 2 == 1;
        const std::uint64_t rare = 1 + random() % 9;
        for (std::int64_t i = 0; i < request.blocks.posts(); ++i) {
            request.skip.push_back(random() % rare == 0 ? Skip::none : Skip::hidden);
            request.fill_m.push_back(-1000.0F - static_cast<float>(i));
        }
        const Chunk all = source->load(request.window, request.lines_are_columns), some = source->load(request);
        if (some.flat) {  // nothing is needed
            CHECK(std::count(request.skip.begin(), request.skip.end(), Skip::none) == 0);
            continue;
        }
        const auto block = [&](std::int64_t c, std::int64_t r) -> std::optional<std::size_t> {
            const Window b = blocks_of({{c, c + 1}, {r, r + 1}});
            if (!request.blocks.columns.contains(b.columns.begin) || !request.blocks.rows.contains(b.rows.begin))
                return {};
            return static_cast<std::size_t>((b.rows.begin - request.blocks.rows.begin) * request.blocks.columns.size() +
                                            b.columns.begin - request.blocks.columns.begin);
        };
        const Window& w = request.window;
        for (std::int64_t r = w.rows.begin; r < w.rows.end; ++r)
            for (std::int64_t c = w.columns.begin; c < w.columns.end; ++c) {
                bool needed = false;
                for (const std::int64_t y : {r - margin, r, r + margin})
                    for (const std::int64_t x : {c - margin, c, c + margin})
                        if (const auto near = block(x, y)) needed = needed || request.skip[*near] == Skip::none;
                const std::int64_t down = r - w.rows.begin, across = c - w.columns.begin;
                const auto i = static_cast<std::size_t>(request.lines_are_columns ? across * w.rows.size() + down
                                                                                  : down * w.columns.size() + across);
                const float z = some.surface_m[i], want = needed ? all.surface_m[i] : request.fill_m[*block(c, r)];
                wrong += !(z == want || (std::isnan(z) && std::isnan(want)));
                ++(needed ? kept : filled);
            }
    }
    CHECK(wrong == 0);
    CHECK(filled > 500000);
    CHECK(kept > 500000);
}

TEST_CASE("tiles that a request does not need are never read, and are counted", "[store]") {
    const Folder folder;
    const Drawing d = hills(640, 512);
    draw(folder / "dem.tif", d);
    Drawing h = d;
    h.no_data.reset();
    h.value = [](int c, int r) { return (c + r) % 5; };
    draw(folder / "height.tif", h);
    auto params = into(folder / "store", {folder / "dem.tif"});
    params.culture_height = folder / "height.tif";
    params.tile_posts = 128;
    params.creation = {"COMPRESS=NONE"};
    write_tile_store(params);
    auto raw_params = base(folder / "dem.tif");
    raw_params.culture_height = folder / "height.tif";

    // Blocks west of post 352 are not needed: the tiles of posts 0 to 255 hold nothing that is, the next some.
    ChunkRequest request;
    request.window = {{10, 600}, {20, 500}};
    request.blocks = blocks_of(request.window);
    for (std::int64_t r = request.blocks.rows.begin; r < request.blocks.rows.end; ++r)
        for (std::int64_t c = request.blocks.columns.begin; c < request.blocks.columns.end; ++c) {
            request.skip.push_back(c < 11 ? (r < 8 ? Skip::horizon : Skip::hidden) : Skip::none);
            request.fill_m.push_back(c < 11 ? -77.0F : 0.0F);
        }
    for (const bool by_columns : {false, true}) {
        request.lines_are_columns = by_columns;
        const auto source = open_direct_source(base(folder / "store")), raw = open_direct_source(raw_params);
        const Chunk some = source->load(request), of_raw = raw->load(request),
                    all = raw->load(request.window, by_columns);
        CHECK(same(some.surface_m, of_raw.surface_m));
        CHECK(same(some.culture_height_m, of_raw.culture_height_m));
        std::int64_t wrong = 0;
        for (std::int64_t r = 20; r < 500; ++r)
            for (std::int64_t c = 10; c < 600; ++c) {
                const std::int64_t line = by_columns ? c - 10 : r - 20, at = by_columns ? r - 20 : c - 10;
                const auto i = static_cast<std::size_t>(line * all.minor_count() + at);
                const bool needed = c >= 350;  // with the margin of two
                const float z = some.surface_m[i], want = needed ? all.surface_m[i] : -77.0F;
                wrong += !(z == want || (std::isnan(z) && std::isnan(want)));
                wrong += some.culture_height_m[i] != (needed ? all.culture_height_m[i] : 0.0F);
            }
        CHECK(wrong == 0);
        CHECK(some.posts_read == (600 - 256) * 480);
        const Skipped skipped = source->skipped();
        const auto of = [&](Skip s) { return skipped[static_cast<std::size_t>(s)]; };
        CHECK(of(Skip::horizon).tiles == 2 * 2 * 2);  // two layers; columns of tiles 0 and 1, rows 0 and 1
        CHECK(of(Skip::hidden).tiles == 2 * 2 * 2);
        CHECK(of(Skip::range).tiles == 0);
        CHECK(of(Skip::hidden).posts == 8 * 128 * 128);
        CHECK(of(Skip::hidden).bytes == 8 * 128 * 128 * 2);
        CHECK(of(Skip::none).tiles == 2 * 5 * 4 - 16);  // all others
        CHECK(of(Skip::none).posts == 2 * 640 * 512 - 16 * 128 * 128);

        // Of what nobody looks at only the reason is noted; the rest is the same.
        for (const Window& looked_at : {Window{{340, 580}, {20, 500}}, Window{{10, 600}, {47, 303}},
                                        Window{{300, 900}, {100, 101}}, Window{{10, 140}, {20, 500}}, Window{}}) {
            const auto other = open_direct_source(base(folder / "store"));
            ChunkRequest narrow = request;
            narrow.looked_at = looked_at;
            const Chunk part = other->load(narrow);
            const Window& w = part.window;
            std::int64_t unlike = 0;
            for (std::int64_t r = w.rows.begin; r < w.rows.end; ++r)
                for (std::int64_t c = w.columns.begin; c < w.columns.end; ++c) {
                    const std::int64_t l = by_columns ? c : r, k = by_columns ? r : c;
                    const auto place = [&](const Chunk& chunk) {
                        const Interval lines = by_columns ? chunk.window.columns : chunk.window.rows,
                                       minors = by_columns ? chunk.window.rows : chunk.window.columns;
                        return static_cast<std::size_t>((chunk.flat ? 0 : l - lines.begin) * minors.size() + k -
                                                        minors.begin);
                    };
                    const float z = part.surface_m[place(part)], want = some.surface_m[place(some)];
                    unlike += !(z == want || (std::isnan(z) && std::isnan(want)));
                }
            INFO(w.columns.begin << " to " << w.columns.end << ", " << w.rows.begin << " to " << w.rows.end);
            CHECK(unlike == 0);
            const Interval columns = intersection(looked_at.columns, request.window.columns),
                           rows = intersection(looked_at.rows, request.window.rows);
            CHECK((w.empty() ? columns.empty() || rows.empty() : w == Window{columns, rows}));
            const Skipped passed = other->skipped();
            const bool all_that_counts = columns.contains(340) && columns.contains(579) && rows == request.window.rows;
            if (all_that_counts)
                for (const Skip why : {Skip::horizon, Skip::hidden, Skip::range, Skip::none})
                    CHECK(passed[static_cast<std::size_t>(why)].tiles == of(why).tiles);
            else
                CHECK(passed[static_cast<std::size_t>(Skip::hidden)].tiles == of(Skip::hidden).tiles);
        }
    }

    // A tile that is not needed may be damaged without anybody noticing; one that is may not.
    const std::string sheet = folder / "store/dem/c0_r0.tif";
    int found = 0;
    {
        GDALDataset* in = GDALDataset::Open(sheet.c_str());
        const char* at = in->GetRasterBand(1)->GetMetadataItem("BLOCK_OFFSET_1_2", "TIFF");
        REQUIRE(at);
        const long offset = std::atol(at);
        GDALClose(in);
        std::fstream file(sheet, std::ios::in | std::ios::out | std::ios::binary);
        file.seekg(offset + 99);
        const char byte = static_cast<char>(file.get());
        file.seekp(offset + 99);
        file.put(static_cast<char>(byte ^ 4));
        ++found;
    }
    REQUIRE(found == 1);
    const auto source = open_direct_source(base(folder / "store"));
    CHECK_NOTHROW(source->load(request));
    CHECK_THAT(refusal([&] { source->load(request.window, false); }),
               Contains("c0_r0.tif") && Contains("tile 1, 2") && Contains("columns 128 to 255, rows 256 to 383") &&
                   Contains("damaged"));
}

TEST_CASE("of open ground every tile within range is read and every other one is out of range", "[store]") {
    const Folder folder;
    Drawing d;
    d.columns = 640;
    d.rows = 500;
    d.type = GDT_Int16;
    d.value = [](int, int) { return 100; };
    draw(folder / "dem.tif", d);
    auto params = into(folder / "store", {folder / "dem.tif"});
    params.tile_posts = 64;
    write_tile_store(params);
    Scene scene;
    scene.geometry = Geometry::grid;
    scene.earth_k.reset();
    scene.platform.xy = PointXY{1005 + 10 * 300.0, 1995 - 10 * 240.0};
    scene.platform.altitude_m = 300;
    scene.range_m = 1500;
    scene.detail = false;
    scene.display.size = 64;
    const double reach = std::sqrt(1500.0 * 1500.0 - 200.0 * 200.0) / 10;  // posts
    std::uint64_t far = 0, out = 0, tiles = 0;
    for (int r = 0; r < 500; r += 64)
        for (int c = 0; c < 640; c += 64) {
            const double x = std::clamp(300, c, c + 63) - 300, y = std::clamp(240, r, r + 63) - 240;
            ++tiles;
            out += std::hypot(x, y) > reach;
            far += std::hypot(x, y) > reach + 50;  // what a block's depth may add where spokes cross it aslant
        }
    REQUIRE(far > 20);
    for (const char* dem : {"store", "dem.tif"})
        for (const bool spilled : {false, true}) {
            CAPTURE(dem, spilled);
            SpillOptions options;
            options.temp_folder = folder / ".";
            const auto source = spilled ? open_spilled_source(base(folder / dem), scene, options)
                                        : open_direct_source(base(folder / dem));
            EngineParams engine;
            engine.wedges = 5;
            const Skipped found = run(resolve(scene, *source), *source, engine).report.skipped;
            const auto of = [&](Skip s) { return found[static_cast<std::size_t>(s)]; };
            SkipCount all;
            for (const SkipCount& s : found) {
                all.posts += s.posts;
                all.bytes += s.bytes;
                all.tiles += s.tiles;
            }
            CHECK(all.posts == 640 * 500);
            CHECK(all.bytes == 640 * 500 * 2);
            CHECK(of(Skip::none).posts + of(Skip::range).posts == all.posts);
            if (spilled || dem != std::string("store")) continue;
            CHECK(all.tiles == tiles);
            CHECK(of(Skip::range).tiles >= far);
            CHECK(of(Skip::range).tiles <= out);
        }
}

TEST_CASE("any byte flipped anywhere in a store is found and its file is named", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(200, 150));
    auto params = into(folder / "store", {folder / "dem.tif"});
    params.culture = folder / "dem.tif";
    params.tile_posts = 64;
    write_tile_store(params);
    PlatformParams point;
    point.xy = PointXY{1500, 1500};
    DataBaseParams layers = base(folder / "store");
    layers.legend = Legend("drawn", {{0, 1}});
    keep_spill(layers, point, folder / "store", {});
    CHECK(describe_store(folder / "store").kept->column == 49.5);
    REQUIRE(verify_store(folder / "store", nullptr, {}).damage.empty());
    const unsigned seed = std::random_device{}();
    INFO("seed " << seed);
    std::mt19937 random(seed);
    for (const auto& [name, bytes] : contents(folder / "store")) {
        const std::string path = folder / ("store/" + name);
        for (int trial = 0; trial < 25; ++trial) {
            std::string changed = bytes;
            const std::size_t at = random() % bytes.size();
            changed[at] = static_cast<char>(changed[at] ^ (1 << random() % 8));
            std::ofstream(path, std::ios::binary) << changed;
            const StoreVerdict verdict = verify_store(folder / "store", nullptr, {});
            INFO(name << " byte " << at);
            REQUIRE_FALSE(verdict.damage.empty());
            CHECK_THAT(verdict.damage[0], Contains(name));
        }
        std::ofstream(path, std::ios::binary) << bytes.substr(0, bytes.size() - 1);
        const StoreVerdict cut = verify_store(folder / "store", nullptr, {});
        REQUIRE_FALSE(cut.damage.empty());
        CHECK_THAT(cut.damage[0], Contains(name));
        fs::remove(path);
        if (name != kept_spill_name)
            CHECK_THAT(verify_store(folder / "store", nullptr, {}).damage.at(0), Contains(name));
        std::ofstream(path, std::ios::binary) << bytes;
    }
    CHECK(verify_store(folder / "store", nullptr, {}).damage.empty());
}

TEST_CASE("a kept spill serves a store that was moved, and lends its block map where memory is little", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(300, 260));
    write_tile_store(into(folder / "made", {folder / "dem.tif"}));
    Scene scene;
    scene.platform.xy = PointXY{2500, 700};
    scene.platform.altitude_m = 3000;
    scene.range_m = 1000;
    SpillOptions options;
    keep_spill(base(folder / "made"), scene.platform, folder / "made", options);
    fs::rename(folder / "made", folder / "moved");
    const auto params = base(folder / "moved");
    const SourceChoice choice = choose_source(params, SourceKind::automatic, scene, options.memory_bytes);
    CHECK(choice.kept);
    CHECK(choice.unfit.empty());
    const auto direct = open_direct_source(params);
    for (const std::size_t memory : {std::size_t{32} << 10, std::size_t{1} << 30}) {
        options.memory_bytes = memory;
        const auto kept = open_source(choice, params, scene, options);
        CHECK(same(heights(*kept), heights(*direct)));
        REQUIRE(kept->block_map());
        const Window all{{0, 10}, {0, 9}};
        CHECK(kept->block_map()->read(0, all).bounds == direct->block_map()->read(0, all).bounds);
    }
    // Made anew from another raster under the same name, the store is another one.
    Drawing other = hills(300, 260);
    other.value = [](int c, int r) { return c + r; };
    draw(folder / "dem.tif", other);
    write_tile_store(into(folder / "again", {folder / "dem.tif"}));
    fs::copy(folder / "moved/wedges.spill", folder / "again/wedges.spill");
    const SourceChoice refused =
        choose_source(base(folder / "again"), SourceKind::automatic, scene, options.memory_bytes);
    CHECK_FALSE(refused.kept);
    CHECK_THAT(refused.unfit, Contains("again/wedges.spill") && Contains("another raster than dem"));
}

TEST_CASE("damage that a run meets is named with its file and block", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(200, 150));
    write_tile_store(into(folder / "store", {folder / "dem.tif"}));
    const auto sound = contents(folder / "store");
    const auto flip = [&](const std::string& name, std::size_t at) {
        std::string bytes = sound.at(name);
        bytes[at] = static_cast<char>(bytes[at] ^ 1);
        std::ofstream(folder / ("store/" + name), std::ios::binary) << bytes;
    };
    const auto restore = [&](const std::string& name) {
        std::ofstream(folder / ("store/" + name), std::ios::binary) << sound.at(name);
    };
    const auto read_all = [&] {
        const auto source = open_direct_source(base(folder / "store"));
        heights(*source);
        source->block_map()->read(0, {{0, 7}, {0, 5}});
    };
    CHECK_NOTHROW(read_all());
    flip("manifest.json", 200);
    CHECK_THAT(refusal(read_all), Contains("manifest.json") && Contains("damaged"));
    restore("manifest.json");
    flip("dem/c0_r0.sum", 60);
    CHECK_THAT(refusal(read_all), Contains("c0_r0.sum") && Contains("damaged"));
    restore("dem/c0_r0.sum");
    flip("blocks.map", 1000);
    CHECK_THAT(refusal(read_all), Contains("blocks.map") && Contains("level 0, block columns 0 to 63"));
    restore("blocks.map");
    std::ofstream(folder / "store/dem/c0_r0.tif", std::ios::binary) << sound.at("dem/c0_r0.tif").substr(0, 500);
    CHECK_THAT(refusal(read_all), Contains("c0_r0.tif") && Contains("500 bytes"));
    restore("dem/c0_r0.tif");
    CHECK_NOTHROW(read_all());
}

TEST_CASE("a scene over a store is the scene over the rasters, bit for bit", "[store][threads]") {
    const Folder folder;
    auto params = into(folder / "store", {data + "/worcester_vermont_dem.tif"});
    params.culture = data + "/worcester_vermont_culture.tif";
    params.culture_height = data + "/worcester_vermont_canopy.tif";
    params.legend_name = "fbfm40";
    params.tile_posts = 64;
    write_tile_store(params);
    auto raw_params = base(params.dems[0]);
    raw_params.culture = params.culture;
    raw_params.culture_height = params.culture_height;
    raw_params.legend = Legend::built_in("fbfm40");
    auto store_params = base(folder / "store");
    raw_params.culture_height_scale = store_params.culture_height_scale = 0.1;
    const auto raw = open_direct_source(raw_params), store = open_direct_source(store_params);
    CHECK(store->data_base().has_culture);
    CHECK(store->data_base().has_culture_height);
    Scene scene;
    const DataBase& d = raw->data_base();
    scene.platform.xy = PointXY{d.origin_x + 0.4 * static_cast<double>(d.columns) * d.step_x,
                                d.origin_y + 0.5 * static_cast<double>(d.rows) * d.step_y};
    scene.platform.altitude_above = AltitudeAbove::sea_level;
    scene.platform.altitude_m = 1400;
    EngineParams engine;
    engine.threads = 2;
    const RunResult a = run(resolve(scene, *raw), *raw, engine), b = run(resolve(scene, *store), *store, engine);
    REQUIRE(a.scene.swept.cells() == b.scene.swept.cells());
    const std::size_t cells = a.scene.swept.cells();
    CHECK(std::memcmp(a.echo_w.row(0), b.echo_w.row(0), cells * sizeof(float)) == 0);
    CHECK(std::memcmp(a.echo_state.row(0), b.echo_state.row(0), cells) == 0);
    std::size_t lit = 0;
    for (std::size_t i = 0; i < cells; ++i) lit += a.echo_w.row(0)[i] > 0;
    CHECK(lit > cells / 10);
}

TEST_CASE("an interrupted run goes on to the same bytes, and redoes no finished sheet", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(4096 * 3 + 10, 70));
    auto params = into(folder / "whole", {folder / "dem.tif"});
    params.threads = 1;
    write_tile_store(params);
    const auto whole = contents(folder / "whole");
    for (const double until : {0.2, 0.5, 0.9}) {
        const std::string output = folder / ("part" + std::to_string(until));
        params.output = output;
        Stop stop;
        params.stop = &stop;
        params.resume = false;
        params.progress = [&](double fraction) {
            if (fraction > until) stop.request(SIGTERM);
        };
        CHECK_THROWS_AS(write_tile_store(params), Interrupted);
        CHECK_FALSE(fs::exists(output));
        REQUIRE(fs::exists(output + ".part"));
        for (const auto& [name, bytes] : contents(output + ".part")) CHECK_FALSE(name.ends_with(".tmp"));
        params.stop = nullptr;
        params.progress = {};
        CHECK_THAT(refusal([&] { write_tile_store(params); }), Contains("--resume"));
        params.resume = true;
        auto other = params;
        other.tile_posts = 128;
        CHECK_THAT(refusal([&] { write_tile_store(other); }), Contains("other rasters or options"));
        const TileStoreSummary summary = write_tile_store(params);
        CHECK(summary.layers[0].reused == (until < 0.5 ? 1 : until < 0.9 ? 2 : 3));
        CHECK(contents(output) == whole);
        CHECK_FALSE(fs::exists(output + ".part"));
    }
    CHECK_THAT(refusal([&] { write_tile_store(params); }), Contains("exists; add --overwrite"));
    params.overwrite = true;
    params.resume = false;
    CHECK_NOTHROW(write_tile_store(params));
    CHECK(contents(params.output) == whole);
    fs::create_directory(folder / "mine");
    std::ofstream(folder / "mine/letter.txt") << "dear";
    params.output = folder / "mine";
    CHECK_THAT(refusal([&] { write_tile_store(params); }), Contains("no tile store"));
    CHECK(fs::exists(folder / "mine/letter.txt"));
}

TEST_CASE("killed at any moment, a run is resumed to the same bytes", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(4096 * 3 + 10, 100));
    const std::vector<std::string> tail = {"-q", "--threads", "1"};
    const auto tile = [&](const std::string& out, std::vector<std::string> more, int kill_us) {
        std::vector<std::string> arguments{"tile", folder / "dem.tif", out};
        arguments.insert(arguments.end(), tail.begin(), tail.end());
        arguments.insert(arguments.end(), more.begin(), more.end());
        return run_program(arguments, folder / "log", kill_us);
    };
    const auto start = std::chrono::steady_clock::now();
    REQUIRE(tile(folder / "whole", {}, 0).code == 0);
    const double took_us = std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count();
    const auto whole = contents(folder / "whole");
    const unsigned seed = std::random_device{}();
    INFO("seed " << seed);
    std::mt19937 random(seed);
    for (int trial = 0; trial < 6; ++trial) {
        const std::string out = folder / ("killed" + std::to_string(trial));
        tile(out, {}, static_cast<int>(took_us * (0.1 + 0.9 * static_cast<double>(random() % 1000) / 1000)) + 1);
        if (!fs::exists(out)) {
            const Outcome again = tile(out, {"--resume"}, 0);
            INFO(again.err);
            REQUIRE(again.code == 0);
        }
        CHECK(contents(out) == whole);
        CHECK_FALSE(fs::exists(out + ".part"));
    }
}

TEST_CASE("killed just before it is put in place, or just begun, a run goes on", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(900, 700));
    auto params = into(folder / "whole", {folder / "dem.tif"});
    write_tile_store(params);
    const auto whole = contents(folder / "whole");
    params.output = folder / "store";
    params.resume = true;
    SECTION("all but the name is there") {
        fs::copy(folder / "whole", folder / "store.part", fs::copy_options::recursive);
    }
    SECTION("no manifest yet") {
        fs::copy(folder / "whole", folder / "store.part", fs::copy_options::recursive);
        fs::remove(folder / "store.part/manifest.json");
    }
    SECTION("only the folder") { fs::create_directory(folder / "store.part"); }
    SECTION("the plan is empty") {
        fs::create_directory(folder / "store.part");
        std::ofstream(folder / "store.part/plan.json").flush();
    }
    write_tile_store(params);
    CHECK(contents(folder / "store") == whole);
    CHECK_FALSE(fs::exists(folder / "store.part"));
}

TEST_CASE("bad posts and truncated rasters are named, and leave nothing behind", "[store]") {
    const Folder folder;
    Drawing d;
    d.columns = 300;
    d.rows = 200;
    d.value = [](int c, int r) { return c == 271 && r == 133 ? std::numeric_limits<double>::infinity() : 10; };
    draw(folder / "wild.tif", d);
    CHECK_THAT(refusal([&] { write_tile_store(into(folder / "store", {folder / "wild.tif"})); }),
               Contains("wild.tif") && Contains("column 271, row 133"));
    d.value = [](int, int) { return 10.0; };
    draw(folder / "short.tif", d);
    fs::resize_file(folder / "short.tif", fs::file_size(folder / "short.tif") / 2);
    CHECK_THAT(refusal([&] { write_tile_store(into(folder / "store", {folder / "short.tif"})); }),
               Contains("short.tif"));
    auto params = into(folder / "store", {folder / "wild.tif"});
    params.tile_posts = 100;
    CHECK_THAT(refusal([&] { write_tile_store(params); }), Contains("tile-size is 100"));
    params.tile_posts = 256;
    params.creation = {"COMPRESS=NONSENSE"};
    CHECK_THAT(refusal([&] { write_tile_store(params); }), Contains("NONSENSE"));
    params.creation = {"BLOCKXSIZE=128"};
    CHECK_THAT(refusal([&] { write_tile_store(params); }), Contains("tile-size is"));
    params.creation = {};
    params.memory_bytes = std::size_t{4} << 20;
    params.cache_bytes = std::size_t{1} << 19;
    CHECK_THAT(refusal([&] { write_tile_store(params); }), Contains("memory is 4 MiB; tiling dem"));
    CHECK(folder.names() == std::vector<std::string>{"short.tif", "wild.tif"});
}

TEST_CASE("a disk that is full is an error with the sheet's name, and what was written goes", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(600, 400));
    const Outcome outcome = run_program({"tile", folder / "dem.tif", folder / "store", "-q", "--co", "COMPRESS=NONE"},
                                        folder / "log", 0, 200000);
    CHECK(outcome.code == 1);
    CHECK_THAT(outcome.err, Contains("c0_r0.tif") && Contains("cannot be written") && Contains("large"));
    CHECK(std::count(outcome.err.begin(), outcome.err.end(), '\n') == 1);
    CHECK(folder.names() == std::vector<std::string>{"dem.tif", "log"});
    REQUIRE(run_program({"tile", folder / "dem.tif", folder / "store", "-q"}, folder / "log").code == 0);
    CHECK(run_program({"tile", folder / "dem.tif", folder / "store", "-q"}, folder / "log").code == 2);
    std::fstream file(folder / "store/dem/c0_r0.sum", std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(50);
    file.put('\0');
    file.close();
    const Outcome damaged = run_program({"info", "--verify", folder / "store"}, folder / "log");
    CHECK(damaged.code == 1);
    CHECK_THAT(damaged.err, Contains("c0_r0.sum") && Contains("1 damage was found"));
}

TEST_CASE("layers are kept as they are up to a size, and packed beyond it or where that is asked for", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(600, 400));
    auto params = into(folder / "store", {folder / "dem.tif"});
    CHECK(TileStoreParams{}.most_as_it_is == std::int64_t{1} << 31);
    struct Case {
        std::int64_t most;
        std::vector<std::string> creation;
        std::string compression, predictor;
    };
    const std::int64_t bytes = 600 * 400 * 2;
    for (const Case& c : {Case{bytes, {}, "", ""}, Case{bytes - 1, {}, "ZSTD", "2"},
                          Case{bytes, {"COMPRESS=ZSTD"}, "ZSTD", "2"}, Case{bytes, {"PREDICTOR=1"}, "ZSTD", ""},
                          Case{bytes, {"ZSTD_LEVEL=3"}, "ZSTD", "2"}, Case{bytes - 1, {"COMPRESS=NONE"}, "", ""},
                          Case{bytes, {"COMPRESS=DEFLATE", "PREDICTOR=1"}, "DEFLATE", ""}}) {
        CAPTURE(c.most, c.creation);
        params.most_as_it_is = c.most;
        params.creation = c.creation;
        params.overwrite = true;
        write_tile_store(params);
        GDALDataset* sheet = GDALDataset::Open((folder / "store/dem/c0_r0.tif").c_str());
        REQUIRE(sheet);
        const auto item = [&](const char* name) {
            const char* words = sheet->GetMetadataItem(name, "IMAGE_STRUCTURE");
            return std::string(words ? words : "");
        };
        CHECK(item("COMPRESSION") == c.compression);
        CHECK(item("PREDICTOR") == c.predictor);
        GDALClose(sheet);
    }
}

TEST_CASE("codes that the legend does not know are counted", "[store]") {
    const Folder folder;
    draw(folder / "dem.tif", hills(100, 80));
    Drawing codes = hills(100, 80);
    codes.value = [](int c, int r) { return c == 4 ? 7777 : r == 2 ? 31 : 11; };
    draw(folder / "codes.tif", codes);
    auto params = into(folder / "store", {folder / "dem.tif"});
    params.culture = folder / "codes.tif";
    params.legend_name = "drawn.csv";
    params.legend_csv = "code,material\n11,water\n";
    params.legend = Legend::from_csv(params.legend_name, params.legend_csv);
    const TileStoreSummary summary = write_tile_store(params);
    REQUIRE(summary.unknown_codes.size() == 2);
    CHECK(summary.unknown_codes[0].code == 31);
    CHECK(summary.unknown_codes[0].cells == 99);
    CHECK(summary.unknown_codes[1].code == 7777);
    CHECK(summary.unknown_codes[1].cells == 80);
    const auto source = open_direct_source(base(folder / "store"));
    CHECK(source->data_base().legend_name == "drawn.csv");
    CHECK(source->load_classes({{10, 11}, {10, 11}}).classes[0] == material_by_name("material", "water"));
}

TEST_CASE("tiling stays within its memory", "[store]") {
    const Folder folder;
    // 144 MB of floats in lines, as plain files have them.
    Drawing d;
    d.columns = d.rows = 6000;
    d.value = [](int c, int r) { return (c ^ r) & 255; };
    draw(folder / "dem.tif", d);
    const Outcome outcome =
        run_program({"tile", folder / "dem.tif", folder / "store", "--memory", "64MiB", "-q"}, folder / "log");
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    CHECK(outcome.peak_bytes <= std::size_t{128} << 20);
#endif
    INFO("peak " << outcome.peak_bytes / 1048576 << " MiB");
    CHECK(run_program({"info", "--verify", folder / "store", "-q"}, folder / "log").code == 0);
}
