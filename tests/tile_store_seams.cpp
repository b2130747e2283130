// Rasters side by side in one tile store: unlike posting, seams and gaps between them, posts on which they disagree, and
// what cannot lie in one grid.
#include <catch2/catch.hpp>

#include <signal.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "lib/error.hpp"
#include "lib/stop.hpp"
#include "tests/refusal.hpp"
#include "tests/tile_stores.hpp"

using namespace wedgescope;
using namespace wedgescope::test;
using Catch::Matchers::Contains;

namespace {

namespace fs = std::filesystem;

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

/// A store of these rasters, in the place of the one before.
TileStoreSummary tile_anew(const Folder& folder, const std::vector<std::string>& given) {
    auto params = into(folder / "store", given);
    params.overwrite = true;
    return write_tile_store(params);
}

std::uint64_t voids(const std::string& store) { return open_direct_source(base(store))->extremes().void_posts; }

}  // namespace

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

TEST_CASE("several rasters of one type keep their values, in the narrowest type that has one for no data", "[store]") {
    struct Kind {
        GDALDataType type;
        std::vector<std::string> creation;
        std::optional<double> no_data;  ///< of both
        double scale;
        std::string stored, note;
    };
    const std::vector<Kind> kinds = {
        {GDT_Byte, {}, {}, 1, "Int16", ""},
        {GDT_Byte, {"PIXELTYPE=SIGNEDBYTE"}, {}, 1, "Int16", ""},
        {GDT_Byte, {}, 255, 1, "Byte", ""},
        {GDT_Byte, {}, {}, 0.5, "Int16", ""},
        {GDT_Int16, {}, {}, 1, "Int16", ""},
        {GDT_UInt16, {}, {}, 1, "Int32", ""},
        {GDT_UInt16, {}, 65535, 1, "UInt16", ""},
        {GDT_UInt16, {}, -9999, 1, "Int32", ""},  // no value of the type
        {GDT_Byte, {}, 256, 1, "Int16", ""},
        {GDT_Int32, {}, {}, 1, "Int32", ""},
        {GDT_UInt32, {}, {}, 1, "Float32", "rasters of UInt32: stored as Float32 metres"},
        {GDT_Float32, {}, -9999, 1, "Float32", ""},
        {GDT_Float32,
         {},
         {},
         0.5,
         "Float32",
         "rasters of Float32 with a scale, an offset or a unit of their own: stored as Float32 metres"},
        {GDT_Float64, {}, {}, 1, "Float32", "rasters of Float64: stored as Float32 metres"},
    };
    for (const Kind& kind : kinds) {
        CAPTURE(GDALGetDataTypeName(kind.type), kind.creation.size(), kind.no_data.value_or(-1), kind.scale);
        const Folder folder;
        const bool below_zero = !kind.creation.empty();
        const auto value = [&](int c, int r) { return 3.0 * c + 10 * r + (below_zero ? -100 : 5); };
        // The second lies two rows lower: voids above it and below the first.
        std::vector<std::string> given;
        for (const int which : {0, 1}) {
            Drawing d;
            d.columns = d.rows = 6;
            d.type = kind.type;
            d.creation = kind.creation;
            d.no_data = kind.no_data;
            d.scale = kind.scale;
            d.geotransform = {{400000.0 + 60 * which, 10, 0, 4000000.0 - 20 * which, 0, -10}};
            d.value = [&value, which](int c, int r) {
                const double z = value(c + 6 * which, r + 2 * which);
                return z < 0 ? z + 256 : z;  // GDAL writes a signed byte's bits
            };
            given.push_back(folder / text("part", which, ".tif"));
            draw(given.back(), d);
        }
        const TileStoreSummary summary = tile_anew(folder, given);
        CHECK(summary.note == kind.note);
        const Plain plain(folder / "store/dem.vrt");
        CHECK(plain.type == kind.stored);
        REQUIRE((plain.columns == 12 && plain.rows == 8));
        const bool metres = kind.stored == "Float32";
        int wrong = 0;
        for (int r = 0; r < 8; ++r)
            for (int c = 0; c < 12; ++c) {
                const double z = plain.at(c, r);
                if (c < 6 ? r >= 6 : r < 2)
                    wrong += !same(z, plain.no_data);
                else
                    wrong += z != value(c, r) * (metres ? kind.scale : 1);
            }
        CHECK(wrong == 0);
        CHECK(voids(folder / "store") == 24);
        CHECK(open_direct_source(base(folder / "store"))->bare_terrain_m(7, 4) ==
              static_cast<float>(value(7, 4) * kind.scale));
    }
}

TEST_CASE("rasters that are told from the south keep their values on the others' posts", "[store]") {
    const Folder folder;
    constexpr int columns = 70, rows = 50;
    // By place: x east and y north of a corner, in posts of 10 m.
    const auto value = [](double x, double y) { return 300 + std::fmod(7 * x + 13 * y, 251); };
    const auto draw_part = [&](const std::string& name, int x, int y, bool from_south, double off = 0) {
        Drawing d;
        d.columns = columns;
        d.rows = rows;
        d.type = GDT_Int16;
        d.no_data = -9999;
        d.geotransform = {
            {400000 + 10.0 * x, 10, 0, 4000000 + 10.0 * (from_south ? y : y + rows), 0, from_south ? 10.0 : -10.0}};
        d.value = [=](int c, int r) { return value(x + c, y + (from_south ? r : rows - 1 - r)) + off; };
        draw(folder / name, d);
        return folder / name;
    };
    const std::string first = draw_part("first.tif", 0, 0, false);
    for (const bool from_south : {false, true})
        for (const bool turned : {false, true}) {
            CAPTURE(from_south, turned);
            const std::string second = draw_part("second.tif", 60, 30, from_south);
            const TileStoreSummary summary =
                tile_anew(folder, turned ? std::vector{second, first} : std::vector{first, second});
            CHECK(summary.note.empty());
            const Plain plain(folder / "store/dem.vrt");
            CHECK(plain.type == "Int16");
            REQUIRE((plain.columns == 130 && plain.rows == 80));
            int wrong = 0;
            for (int r = 0; r < plain.rows; ++r)
                for (int c = 0; c < plain.columns; ++c) {
                    const double x = (plain.g[0] + (c + 0.5) * plain.g[1] - 400000) / 10 - 0.5,
                                 y = (plain.g[3] + (r + 0.5) * plain.g[5] - 4000000) / 10 - 0.5;
                    const bool inside = (x < 70 && y < 50) || (x >= 60 && y >= 30);
                    wrong += plain.at(c, r) != (inside ? value(std::round(x), std::round(y)) : plain.no_data);
                }
            CHECK(wrong == 0);
            CHECK(summary.disagreements == 0);
        }
    // On a post of its own a metre is a difference.
    CHECK(tile_anew(folder, {first, draw_part("second.tif", 60, 30, true, 1)}).disagreements == 10 * 20);
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
        const TileStoreSummary summary = tile_anew(folder, given);
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
    write_until(params, 0.2);
    params.resume = true;
    CHECK(write_tile_store(params).layers[0].reused == 1);
    CHECK(contents(folder / "part") == whole);
}

TEST_CASE("pixels of 15 m and 30 m that meet edge to edge leave no void, a gap between them does", "[store]") {
    const Folder folder;
    const std::string left = draw_plane(folder, "left.tif", 40, 20, 7.5, 7.5, 15, 15);
    const auto right = [&](double gap_m) { return draw_plane(folder, "right.tif", 20, 10, 615 + gap_m, 15, 30, 30); };
    const auto tiled = [&](const std::vector<std::string>& given) { return tile_anew(folder, given); };
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
    const auto tiled = [&](const std::vector<std::string>& given) { return tile_anew(folder, given); };
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
        return tile_anew(folder, {folder / first, folder / second});
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

TEST_CASE("rasters that go round the earth together become one circle, whatever lies over its seam", "[store]") {
    const Folder folder;
    struct Ground {
        double west, north, step;
        int columns, rows;
        double height_m;
    };
    const auto height = [](double lon, double lat, double base_m) {
        return base_m + 400 * std::sin(lon * std::numbers::pi / 180) + 3 * lat;
    };
    const auto make = [&](const std::string& name, const Ground& g) {
        Drawing d;
        d.columns = g.columns;
        d.rows = g.rows;
        d.type = GDT_Float32;
        d.crs = "EPSG:4326";
        d.geotransform = {{g.west, g.step, 0, g.north, 0, -g.step}};
        d.value = [&](int c, int r) {
            return height(g.west + (c + 0.5) * g.step, g.north - (r + 0.5) * g.step, g.height_m);
        };
        draw(folder / name, d);
        return folder / name;
    };
    struct Case {
        std::vector<Ground> grounds;
        double west, step;                           // of the store's first column, and of all
        double inset_west, inset_east, tolerance_m;  // where the first or the last stands above the others
        bool inset_wins;
        std::size_t disagreements;
    };
    const Ground world{-180, 20, 0.5, 720, 60, 0}, from_greenwich{0, 20, 0.5, 720, 60, 0},
        closed{-180.25, 20, 0.5, 721, 60, 0}, over_date_line{175, 10, 0.5, 20, 20, 1000},
        over_greenwich{-5, 10, 0.5, 20, 20, 1000};
    const std::vector<Case> cases{
        {{over_date_line, world}, -180, 0.5, 175, 185, 0, true, 400},
        {{world, over_date_line}, -180, 0.5, 175, 185, 0, false, 400},
        {{over_greenwich, from_greenwich}, 0, 0.5, -5, 5, 0, true, 400},
        // Its last column repeats its first.
        {{{-5.25, 10, 0.5, 20, 20, 1000}, closed}, -180.25, 0.5, -5.25, 4.75, 0, true, 400},
        // Resampled: of a sine with posts half a degree apart the chord lies below it by 4 mm; of the rows half a post is added.
        {{{10, 10, 0.25, 40, 40, 0}, world}, -180, 0.25, 0, 0, 0.9, true, 0},
        {{{-180, 20, 0.25, 720, 120, 0}, {0, 20, 0.5, 360, 60, 0}}, -180, 0.25, 0, 0, 0.9, true, 0},
        {{{0, 20, 0.5, 360, 60, 0}, {-180, 20, 0.25, 720, 120, 0}}, -180, 0.25, 0, 0, 0.9, true, 0},
    };
    for (std::size_t k = 0; k < cases.size(); ++k) {
        const Case& one = cases[k];
        CAPTURE(k);
        std::vector<std::string> paths;
        for (std::size_t i = 0; i < one.grounds.size(); ++i)
            paths.push_back(make(std::to_string(k) + "_" + std::to_string(i) + ".tif", one.grounds[i]));
        const std::string store = folder / ("store" + std::to_string(k));
        const TileStoreSummary summary = write_tile_store(into(store, paths));
        CHECK(static_cast<std::size_t>(summary.disagreements) == one.disagreements);
        const auto source = open_direct_source(base(store));
        const DataBase& db = source->data_base();
        REQUIRE(db.columns == std::lround(360 / one.step));
        CHECK(db.cyclic);
        CHECK(db.locate(0.0, one.west + one.step / 2).column == Approx(0).margin(1e-6));
        const RawVector<float> z = heights(*source);
        std::int64_t wrong = 0, insets = 0;
        for (std::int64_t r = 0; r < db.rows; ++r)
            for (std::int64_t c = 0; c < db.columns; ++c) {
                const auto place = db.lat_lon(static_cast<double>(c), static_cast<double>(r));
                REQUIRE(place);
                const auto [lat, lon] = *place;
                const double on = lon < one.inset_west - 180 ? lon + 360 : lon;
                const bool inset = one.inset_wins && on > one.inset_west && on < one.inset_east && lat > 0 && lat < 10;
                insets += inset;
                const double truth = height(lon, lat, inset ? 1000 : 0);
                wrong += !(std::abs(static_cast<double>(z[static_cast<std::size_t>(r * db.columns + c)]) - truth) <=
                           std::max(one.tolerance_m, 1e-3));
            }
        CHECK(wrong == 0);
        CHECK(insets == (one.inset_wins && one.inset_east > one.inset_west ? 400 : 0));
    }
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
