// The promise of --memory, measured from outside: no command ever holds more than it and 64 MiB.
#include <gdal_utils.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <regex>

#include "tests/drawn_raster.hpp"
#include "tests/program.hpp"
#include "tests/words.hpp"

using namespace wedgescope::test;

namespace {

using wedgescope::test::with;

const std::string program = WEDGESCOPE_PROGRAM;
constexpr std::uint64_t mebibyte = std::uint64_t{1} << 20;

/// How a raster is stored.
struct Shape {
    int posts = 1024;
    GDALDataType type = GDT_Int16;
    int columns = 256, rows = 256;  ///< of a block; as wide as the raster: strips
    const char* compression = "NONE";
    int bands = 1;                        ///< all alike, pixel by pixel in the file
    int first_column = 0, first_row = 0;  ///< of the hills; 10 m each
};

/// Draws by a process of its own: what this one once held counts as held by all it starts.
template <class Draw>
void draw_apart(const std::string& path, Draw&& draw) {
    const pid_t child = ::fork();
    if (child == 0) {
        try {
            draw();
        } catch (...) {
            ::_exit(1);
        }
        ::_exit(0);
    }
    int status = 0;
    if (child < 0 || ::waitpid(child, &status, 0) != child || status != 0)
        throw std::runtime_error("cannot draw " + path);
}

/// Hills of 10 m posts.
void draw_hills(const std::string& path, const Shape& shape) {
    draw_apart(path, [&] {
        GDALAllRegister();
        GDALSetCacheMax64(GIntBig{8} << 20);
        CPLStringList options;
        const bool tiled = shape.columns != shape.posts;
        options.SetNameValue("TILED", tiled ? "YES" : "NO");
        if (tiled) options.SetNameValue("BLOCKXSIZE", std::to_string(shape.columns).c_str());
        options.SetNameValue("BLOCKYSIZE", std::to_string(shape.rows).c_str());
        options.SetNameValue("COMPRESS", shape.compression);
        if (EQUAL(shape.compression, "ZSTD")) options.SetNameValue("ZSTD_LEVEL", "1");
        options.SetNameValue("INTERLEAVE", "PIXEL");
        GDALDataset* out = GetGDALDriverManager()->GetDriverByName("GTiff")->Create(
            path.c_str(), shape.posts, shape.posts, shape.bands, shape.type, options.List());
        if (!out) ::_exit(1);
        double terms[6] = {400000.0 + 10 * shape.first_column, 10, 0, 4500000.0 - 10 * shape.first_row, 0, -10};
        out->SetGeoTransform(terms);
        OGRSpatialReference crs;
        crs.importFromEPSG(32611);
        out->SetSpatialRef(&crs);
        std::vector<double> wave(4096);
        for (std::size_t i = 0; i < wave.size(); ++i)
            wave[i] = 220 * std::sin(static_cast<double>(i) / 4096 * 6.283185307179586);
        std::vector<float> block(static_cast<std::size_t>(shape.columns) * static_cast<std::size_t>(shape.rows));
        std::vector<std::int16_t> whole(block.size());
        for (int ty = 0; ty * shape.rows < shape.posts; ++ty)
            for (int tx = 0; tx * shape.columns < shape.posts; ++tx) {
                std::size_t at = 0;
                for (int y = 0; y < shape.rows; ++y)
                    for (int x = 0; x < shape.columns; ++x, ++at) {
                        const auto c = static_cast<std::size_t>(shape.first_column + tx * shape.columns + x),
                                   r = static_cast<std::size_t>(shape.first_row + ty * shape.rows + y);
                        const double z = 500 + wave[(7 * c + 3 * r) & 4095] + wave[(23 * r - 11 * c) & 4095];
                        block[at] = static_cast<float>(z);
                        whole[at] = static_cast<std::int16_t>(z);
                    }
                void* values = shape.type == GDT_Float32 ? static_cast<void*>(block.data()) : whole.data();
                for (int band = 1; band <= shape.bands; ++band)
                    if (out->GetRasterBand(band)->WriteBlock(tx, ty, values) != CE_None) ::_exit(1);
            }
        GDALClose(out);
    });
}

/// Rough hills of 5001 x 5001 posts of 10 m in 100 files of unlike make that share their edges, under a VRT.
void draw_mosaic(const Folder& folder, const std::string& vrt) {
    draw_apart(vrt, [&] {
        GDALAllRegister();
        constexpr int edge = 501, step = edge - 1, across = 10;
        const std::vector<std::vector<const char*>> makes = {
            {"TILED=YES", "COMPRESS=DEFLATE", nullptr}, {"COMPRESS=LZW", nullptr}, {nullptr}};
        OGRSpatialReference crs;
        crs.importFromEPSG(32611);
        std::vector<std::int16_t> posts(edge * edge);
        std::vector<std::string> names;
        for (int part = 0; part < across * across; ++part) {
            const int left = part % across * step, top = part / across * step;
            names.push_back(folder / ("part" + std::to_string(part) + ".tif"));
            const auto make = makes[static_cast<std::size_t>(part) % makes.size()];
            GDALDataset* out = GetGDALDriverManager()->GetDriverByName("GTiff")->Create(
                names.back().c_str(), edge, edge, 1, GDT_Int16, const_cast<char**>(make.data()));
            if (!out) ::_exit(1);
            double terms[6] = {400000 + 10.0 * left, 10, 0, 4500000 - 10.0 * top, 0, -10};
            out->SetGeoTransform(terms);
            out->SetSpatialRef(&crs);
            for (int y = 0; y < edge; ++y)
                for (int x = 0; x < edge; ++x) {
                    const int c = left + x, r = top + y;
                    const auto noise = static_cast<unsigned>(c) * 2654435761U ^ static_cast<unsigned>(r) * 40503U * 77U;
                    const double z =
                        800 + 200 * std::sin(c * 0.011 + r * 0.004) + 150 * std::sin(r * 0.017 - c * 0.006);
                    posts[static_cast<std::size_t>(y * edge + x)] =
                        static_cast<std::int16_t>(z + static_cast<double>(noise >> 13 & 31));
                }
            if (out->GetRasterBand(1)->RasterIO(GF_Write, 0, 0, edge, edge, posts.data(), edge, edge, GDT_Int16, 0, 0,
                                                nullptr) != CE_None)
                ::_exit(1);
            GDALClose(out);
        }
        std::vector<const char*> list;
        for (const std::string& name : names) list.push_back(name.c_str());
        int bad = 0;
        GDALDatasetH made =
            GDALBuildVRT(vrt.c_str(), static_cast<int>(list.size()), nullptr, list.data(), nullptr, &bad);
        if (!made || bad) ::_exit(1);
        GDALClose(made);
    });
}

/// Cells on the posts of as many hills.
void draw_cells(const std::string& path, int cells, GDALDataType type, std::function<double(int, int)> value) {
    draw_apart(path, [&] {
        Drawing d;
        d.columns = d.rows = cells;
        d.type = type;
        d.value = std::move(value);
        d.geotransform = {400000, 10, 0, 4500000, 0, -10};
        draw(path, d);
    });
}

/// A run of the program with a budget; however it ends, it holds no more than that and 64 MiB.
struct Budgeted {
    std::string command;
    Ended ended;
    Budgeted(std::uint64_t mib, std::vector<std::string> words, const std::string& log) {
        words.insert(words.begin(), program);
        words.insert(words.end(), {"--memory", std::to_string(mib) + "MiB"});
        for (const std::string& word : words) command += word + " ";
        ended = run_program(words, log);
        INFO(command << "\n" << ended.err);
        CHECK(ended.peak_rss_bytes <= (mib + 64) * mebibyte);
    }
};

/// It ends well.
void check(std::uint64_t mib, const std::vector<std::string>& words, const std::string& log) {
    const Budgeted run(mib, words, log);
    INFO(run.command << "\n" << run.ended.err);
    CHECK(run.ended.code == 0);
}

/// It is refused in one line, which names how many MiB will do.
std::uint64_t enough_after_refusal(std::uint64_t mib, const std::vector<std::string>& words, const std::string& log) {
    const Budgeted refused(mib, words, log);
    INFO(refused.command << "\n" << refused.ended.err);
    CHECK(refused.ended.code == 2);
    CHECK(std::count(refused.ended.err.begin(), refused.ended.err.end(), '\n') == 1);
    std::smatch least;
    const std::regex number("needs at least ([0-9]+) MiB");
    REQUIRE(std::regex_search(refused.ended.err, least, number));
    return std::stoull(least[1].str());
}

/// It is refused so; what the refusal names, and is returned, will do, and one MiB less is refused too.
std::uint64_t check_refused(std::uint64_t mib, const std::vector<std::string>& words, const std::string& log) {
    const std::uint64_t enough = enough_after_refusal(mib, words, log);
    check(enough, words, log);
    const Budgeted less(enough - 1, words, log);
    INFO(less.command << "\n" << less.ended.err);
    CHECK(less.ended.code == 2);
    return enough;
}

std::string text_of(const std::string& path) {
    std::ostringstream all;
    all << std::ifstream(path).rdbuf();
    return all.str();
}

/// The first number of that name in a report.
std::uint64_t number_in(const std::string& report, const std::string& name) {
    const std::string all = text_of(report);
    std::smatch found;
    REQUIRE(std::regex_search(all, found, std::regex("\"" + name + "\": ([0-9]+)")));
    return std::stoull(found[1].str());
}

}  // namespace

TEST_CASE("no command holds more than --memory and 64 MiB, on a raster ten times as large", "[memory]") {
    const Folder folder;
    const std::string hills = folder / "hills.tif";
    draw_hills(hills, {.posts = 18400});  // 646 MiB
    const std::string log = folder / "log";
    const std::vector<std::string> place = {"--xy", "492000,4408000", "--altitude-agl", "900m", "--overwrite", "-q"};
    const std::vector<std::string> simulate =
        with({"simulate", "--dem", hills, "--azimuth-bins", "480", "--range-bin", "150m", "-o", folder / "scope.png"},
             place);
    const std::vector<std::string> far = with(simulate, {"--range", "45km"}),
                                   near = with(simulate, {"--range", "25km"});
    for (const char* threads : {"1", "2"}) check(64, with(far, {"--threads", threads, "--size", "512"}), log);
    // However many threads are asked for, those that could only wait are not made.
    check(64, with(near, {"--threads", "4096", "--size", "512"}), log);
    check(128, with(far, {"--no-cull", "--wedges", "3", "--size", "512"}), log);
    check(96,
          with(far, {"--echo", folder / "echo.tif", "--power", folder / "power.tif", "--states", folder / "states.tif",
                     "--size", "2500", "--noise", "on", "--speckle", "3"}),
          log);
    check(64,
          with(near, {"--source", "spilled", "--work-dir", folder / "work", "--temp-dir", folder / ".", "--report",
                      folder / "report.json"}),
          log);
    CHECK(number_in(folder / "report.json", "spilled_bytes") > 16 * mebibyte);
    std::vector<std::string> plan = with({"info", "--plan", "--dem", hills, "--range", "45km"}, place);
    std::erase(plan, "--overwrite");
    check(64, plan, log);
    check(64, {"info", hills}, log);
    for (const std::uint64_t memory : {64, 256})
        check(memory, with({"coverage", hills, folder / "seen.tif", "--threads", "2"}, place), log);
    check(128, with({"coverage", hills, folder / "seen.tif", "--layer", "height", "--range", "12km"}, place), log);
}

TEST_CASE("rasters of large blocks keep to --memory too", "[memory]") {
    const Folder folder;
    const std::string log = folder / "log";
    const std::vector<std::string> place = {"--xy", "424000,4476000", "--altitude-agl", "2km", "--overwrite", "-q"};
    const auto coverage = [&](const std::string& raster) {
        return with({"coverage", raster, folder / "seen.tif", "--threads", "2"}, place);
    };
    const auto simulate = [&](const std::string& raster, const std::string& source) {
        return with({"simulate", "--dem", raster, "--source", source, "--range", "12km", "--range-bin", "100m", "-o",
                     folder / "scope.png", "--threads", "2"},
                    place);
    };
    const std::string tiles = folder / "tiles.tif", strips = folder / "strips.tif", strip = folder / "strip.tif",
                      store = folder / "store";
    draw_hills(tiles, {4096, GDT_Float32, 1024, 1024, "ZSTD"});
    check(64, coverage(tiles), log);
    check(64, simulate(tiles, "direct"), log);
    check(64, simulate(tiles, "auto"), log);
    check(64, {"info", tiles}, log);
    check(64, {"tile", tiles, store, "--tile-size", "512", "--co", "COMPRESS=ZSTD", "--overwrite", "-q", "--threads", "2"},
          log);
    check(64, coverage(store), log);
    check(64, {"info", "--verify", store, "-q"}, log);

    draw_hills(strips, {6000, GDT_Int16, 6000, 300, "ZSTD"});
    check(64, coverage(strips), log);
    check(64, simulate(strips, "direct"), log);
    draw_hills(strips, {6000, GDT_Int16, 6000, 1500, "ZSTD"});
    check(64, coverage(strips), log);
    check(64, simulate(strips, "auto"), log);

    draw_hills(strip, {4000, GDT_Float32, 4000, 4000, "ZSTD"});
    check_refused(64, coverage(strip), log);
    check_refused(64, simulate(strip, "direct"), log);
    check_refused(64, simulate(strip, "auto"), log);
    check_refused(64, {"info", strip}, log);
    check_refused(64, {"tile", strip, store, "--overwrite", "-q"}, log);

    // Behind two VRTs too, of which the outer one knows nothing of the strip.
    const std::string inner = folder / "inner.vrt", outer = folder / "outer.vrt";
    for (const auto& [from, to] : {std::pair{strip, inner}, {inner, outer}})
        std::ofstream(to)
            << R"(<VRTDataset rasterXSize="4000" rasterYSize="4000"><SRS>EPSG:32611</SRS>)"
            << R"(<GeoTransform>400000,10,0,4500000,0,-10</GeoTransform>)"
            << R"(<VRTRasterBand dataType="Float32" band="1"><SimpleSource><SourceFilename>)" << from
            << R"(</SourceFilename><SourceBand>1</SourceBand></SimpleSource></VRTRasterBand></VRTDataset>)";
    enough_after_refusal(64, coverage(outer), log);
    enough_after_refusal(64, simulate(outer, "auto"), log);
    enough_after_refusal(64, {"tile", outer, store, "--overwrite", "-q"}, log);
}

TEST_CASE("a kept spill, a mosaic and interleaved bands keep to --memory too", "[memory]") {
    const Folder folder;
    const std::string log = folder / "log", report = folder / "report.json";
    // 36 km east and 36 km south of the corner.
    const std::vector<std::string> place = {
        "--latlon", "40.322,-117.756", "--altitude-agl", "2km", "--threads", "2", "--overwrite", "-q"};
    const auto coverage = [&](const std::string& raster) {
        return with({"coverage", raster, folder / "seen.tif"}, place);
    };
    const auto simulate = [&](const std::string& raster, const std::string& range = "20km") {
        return with({"simulate", "--dem", raster, "--range", range, "--range-bin", "100m", "--size", "512", "--report",
                     report, "-o", folder / "scope.png"},
                    place);
    };
    // Four files of 3600 x 3600 posts, 99 MiB in all, side by side.
    std::string mosaic =
        "<VRTDataset rasterXSize=\"7200\" rasterYSize=\"7200\"><SRS>EPSG:32611</SRS><GeoTransform>"
        "400000, 10, 0, 4500000, 0, -10</GeoTransform><VRTRasterBand dataType=\"Int16\" band=\"1\">";
    for (const int column : {0, 3600})
        for (const int row : {0, 3600}) {
            const std::string name = "part" + std::to_string(column) + "_" + std::to_string(row) + ".tif";
            draw_hills(folder / name, {.posts = 3600,
                                       .columns = 512,
                                       .rows = 512,
                                       .compression = "ZSTD",
                                       .first_column = column,
                                       .first_row = row});
            const std::string size = "xSize=\"3600\" ySize=\"3600\"";
            mosaic += "<SimpleSource><SourceFilename relativeToVRT=\"1\">" + name +
                      "</SourceFilename><SourceBand>1</SourceBand><SrcRect xOff=\"0\" yOff=\"0\" " + size +
                      "/><DstRect xOff=\"" + std::to_string(column) + "\" yOff=\"" + std::to_string(row) + "\" " +
                      size + "/></SimpleSource>";
        }
    std::ofstream(folder / "mosaic.vrt") << mosaic << "</VRTRasterBand></VRTDataset>";
    check(64, coverage(folder / "mosaic.vrt"), log);
    check(64, simulate(folder / "mosaic.vrt"), log);
    check(64, {"info", folder / "mosaic.vrt"}, log);

    // Its store, sorted round the sensor.
    const std::string store = folder / "store";
    check(64, {"tile", folder / "mosaic.vrt", store, "--around", "40.322,-117.756", "--co", "COMPRESS=ZSTD", "-q", "--threads",
               "2"},
          log);
    check(64, simulate(store), log);
    CHECK_THAT(text_of(report), Catch::Contains("wedges.spill"));
    CHECK(number_in(report, "spill_read_bytes") > 8 * mebibyte);
    check(64, coverage(store), log);
    check(64, {"tile", store, "--around", "40.4,-117.8", "--overwrite", "-q", "--threads", "2"}, log);

    // A block of the first band brings those of the others into GDAL's cache.
    const std::string bands = folder / "bands.tif";
    draw_hills(bands,
               {.posts = 4096, .type = GDT_Float32, .columns = 512, .rows = 512, .compression = "ZSTD", .bands = 4});
    check(64, coverage(bands), log);
    check(64, simulate(bands), log);
    check(64, with(simulate(bands, "8km"), {"--source", "direct"}), log);
    check(64, {"info", bands}, log);
    check(64, {"tile", bands, store, "--co", "COMPRESS=ZSTD", "--overwrite", "-q", "--threads", "2"}, log);
}

TEST_CASE("the budget that a refusal names will do", "[memory]") {
    const Folder folder;
    const std::string hills = folder / "hills.tif", lines = folder / "lines.tif", log = folder / "log";
    const auto simulate = [&](const std::string& raster, const std::string& place) {
        return std::vector<std::string>{"simulate", "--dem", raster, "--xy",        place, "--altitude-agl",    "900m",
                                        "--size",   "3000",  "-q",   "--overwrite", "-o",  folder / "scope.png"};
    };
    draw_hills(hills, {});
    check_refused(16, simulate(hills, "405000,4495000"), log);
    // Scanlines: spilled, and refused before the pass.
    draw_hills(lines, {4500, GDT_Int16, 4500, 1, "ZSTD"});
    // The same is named whatever was too little. With the response of the posts beside the picture, from the same blocks,
    // which lie in all directions.
    for (const std::vector<std::string>& more :
         {std::vector<std::string>{"--range", "30km"},
          {"--range", "30km", "--sector", "0deg,60deg", "--ground", folder / "ground.tif"}}) {
        const auto words = with(simulate(lines, "422000,4478000"), more);
        CHECK(enough_after_refusal(2, words, log) == check_refused(40, words, log));
    }
    // Weights of a wide beam in narrow bins, under a pulse that is as long as the range.
    check_refused(450,
                  {"simulate",
                   "--dem",
                   hills,
                   "--xy",
                   "405000,4495000",
                   "--altitude-agl",
                   "500m",
                   "--beam",
                   "90deg",
                   "--pulse",
                   "50us",
                   "--range",
                   "8km",
                   "--range-bin",
                   "2m",
                   "--sector",
                   "0deg,0.5deg",
                   "--azimuth-bins",
                   "20000",
                   "--rings",
                   "off",
                   "--size",
                   "256",
                   "-q",
                   "--overwrite",
                   "-o",
                   folder / "scope.png"},
                  log);
    // More columns than a word each would fit for.
    const std::string wide = folder / "wide.vrt";
    std::ofstream(wide) << R"(<VRTDataset rasterXSize="10000000" rasterYSize="300"><SRS>EPSG:32611</SRS>)"
                        << R"(<GeoTransform>500000,1,0,4000000,0,-1</GeoTransform>)"
                        << R"(<VRTRasterBand dataType="Int16" band="1"/></VRTDataset>)";
    check_refused(2,
                  {"coverage", wide, folder / "seen.tif", "--source", "direct", "--xy", "500300.5,3999850.5",
                   "--altitude-agl", "50m", "--geometry", "grid", "--range", "500m", "-q", "--overwrite"},
                  log);
    check_refused(2,
                  {"coverage", lines, folder / "seen.tif", "--xy", "422000,4478000", "--altitude-agl", "900m", "-q",
                   "--overwrite"},
                  log);
}

TEST_CASE("a narrow sector of a fine beam keeps to --memory, with the noise of the sector alone", "[memory]") {
    const Folder folder;
    const std::string hills = folder / "hills.tif", log = folder / "log";
    draw_hills(hills, {});
    const auto simulate = [&](std::vector<std::string> more) {
        return with(with({"simulate", "--dem", hills, "--xy", "405000,4495000", "--altitude-msl", "3km", "--overwrite",
                          "-q", "-o", folder / "scope.png", "--size", "300"},
                         {"--threads", "2"}),
                    std::move(more));
    };
    check(64,
          simulate(
              {"--sector", "0deg,1deg", "--beam", "0.03deg", "--range-bin", "1m", "--range", "9km", "--noise", "on"}),
          log);
    // In bins of ground range each has a pulse of its own, near the sensor a long one.
    check(48,
          simulate({"--display", "gpi-true", "--sector", "0deg,10deg", "--range-bin", "1m", "--range", "9km", "--pulse",
                    "20us", "--noise", "on"}),
          log);
}

TEST_CASE("a scene is refused for its range bins before anything is made for each of them", "[memory]") {
    const Folder folder;
    const std::string hills = folder / "hills.tif";
    draw_hills(hills, {});
    const Budgeted run(16,
                       {"simulate", "--dem", hills, "--xy", "405000,4495000", "--altitude-msl", "3km", "--range",
                        "10km", "--range-bin", "0.001m", "--power", folder / "power.tif", "-q"},
                       folder / "log");
    INFO(run.ended.err);
    CHECK(run.ended.code == 2);
    CHECK_THAT(run.ended.err,
               Catch::Contains("this scene needs at least") && Catch::Contains("(960 x 10000000 cells)"));
}

TEST_CASE("a track of frames side by side keeps to --memory too", "[memory]") {
    const Folder folder;
    const std::string hills = folder / "hills.tif", small = folder / "small.tif", log = folder / "log",
                      track = folder / "track.csv", report = folder / "report.json";
    draw_hills(hills, {.posts = 9000});  // 155 MiB
    draw_hills(small, {});
    const auto rows = [&](int x, int y, int step, int count) {
        std::ofstream out(track);
        out << "time,x,y,altitude-agl,heading\n";
        for (int i = 0; i < count; ++i)
            out << i << ',' << x + i * step << ',' << y + i * step << ',' << 900 + 50 * i << ',' << 30 * i << '\n';
    };
    const auto simulate = [&](const std::string& raster) {
        return std::vector<std::string>{"simulate",       "--dem",    raster, "--track",     track, "-o",
                                        folder / "s.png", "--report", report, "--overwrite", "-q"};
    };
    rows(440000, 4460000, 500, 3);
    const std::vector<std::string> far =
        with(simulate(hills), {"--range", "20km", "--range-bin", "75m", "--size", "400"});
    check(64, with(far, {"--threads", "2"}), log);
    CHECK(number_in(report, "frame_count") == 3);
    check(64, with(far, {"--threads", "1", "--echo", folder / "e.tif", "--power", folder / "p.tif"}), log);
    check(96, with(far, {"--threads", "3", "--scan-step", "320", "--scan-period", "2s"}), log);
    // Small enough to stay in memory; then so many frames at a time as fit.
    rows(404000, 4496000, 10, 5);
    check(256, with(simulate(small), {"--threads", "4", "--size", "400"}), log);
    CHECK(number_in(report, "lanes") == 4);
    check(64, with(simulate(small), {"--threads", "4", "--size", "2500"}), log);
    CHECK(number_in(report, "lanes") < 4);
    check_refused(8, with(simulate(small), {"--threads", "2", "--size", "400"}), log);
    check_refused(
        8, with(simulate(small), {"--threads", "2", "--size", "400", "--scan-step", "100", "--scan-period", "2s"}),
        log);
}

TEST_CASE("counts of many observers keep to --memory too, in a file where they do not fit", "[memory]") {
    const Folder folder;
    const std::string hills = folder / "hills.tif", small = folder / "small.tif", log = folder / "log",
                      places = folder / "places.csv", report = folder / "report.json";
    draw_hills(hills, {.posts = 10000});  // 191 MiB; counts take 100 MiB, of more than 253 observers 200 MiB
    draw_hills(small, {});
    const auto observers = [&](int count, int step, const std::string& height) {
        std::ofstream out(places);
        out << "x,y,height\n";
        for (int i = 0; i < count; ++i) out << 403000 + i * step << ',' << 4496000 - i * step << ',' << height << '\n';
    };
    const auto coverage = [&](const std::string& raster) {
        return std::vector<std::string>{"coverage", raster, folder / "counts.tif", "--observers", places,
                                        "--report", report, "--temp-dir",          folder / ".",  "--overwrite",
                                        "-q"};
    };
    observers(3, 40000, "900");
    check(64, with(coverage(hills), {"--threads", "2"}), log);
    CHECK(number_in(report, "scratch_written_bytes") > 64 * mebibyte);
    check(256, with(coverage(hills), {"--threads", "3", "--at-least", "2"}), log);
    CHECK(number_in(report, "lanes") == 3);
    // So many that counts take 16 bits; each sees little.
    observers(400, 230, "20");
    check(64, with(coverage(hills), {"--range", "1km", "--threads", "2"}), log);
    CHECK(number_in(report, "observer_count") == 400);
    observers(5, 500, "20");
    check(48, with(coverage(small), {"--threads", "2"}), log);
    check_refused(8, with(coverage(small), {"--threads", "2"}), log);
    for (const std::string& name : folder.names()) CHECK(name.find("wedgescope") == std::string::npos);
}

TEST_CASE("a VRT of a hundred rasters keeps to --memory, however many of them are open", "[memory]") {
    const Folder folder;
    const std::string mosaic = folder / "all.vrt", log = folder / "log";
    draw_mosaic(folder, mosaic);
    const std::vector<std::string> simulate = {"simulate",          "--dem", mosaic,        "--xy",  "425005,4474995",
                                               "--altitude-agl",    "500m",  "--range-bin", "6.25m", "--echo",
                                               folder / "echo.tif", "-q",    "--overwrite"};
    for (const char* threads : {"1", "2"}) check(100, with(simulate, {"--threads", threads}), log);
    check(128, with(simulate, {"--source", "spilled"}), log);
    check(64,
          {"coverage", mosaic, folder / "seen.tif", "--xy", "425005,4474995", "--altitude-agl", "500m", "-q",
           "--overwrite"},
          log);
    check(64, {"tile", mosaic, folder / "store", "-q"}, log);
}

TEST_CASE("culture with a code for each cell keeps to --memory, and is doubted", "[memory]") {
    const Folder folder;
    const std::string hills = folder / "hills.tif", parcels = folder / "parcels.tif", sides = folder / "sides.tif",
                      words = folder / "words.tif", log = folder / "log", store = folder / "store";
    constexpr int cells = 1500;
    draw_hills(hills, {.posts = cells});
    draw_cells(parcels, cells, GDT_Int32, [](int c, int r) { return 100000 + r * cells + c; });
    draw_cells(sides, cells, GDT_Int16, [](int c, int r) { return (7 * c + 3 * r) % 541; });
    const std::vector<std::string> tile = {"tile",   hills,       store, "--culture",  parcels, "--culture-legend",
                                           "fbfm40", "--threads", "2",   "--overwrite"};
    const Budgeted told(64, tile, log);
    CHECK(told.ended.code == 0);
    CHECK_THAT(told.ended.err,
               Catch::Contains("more than 16384 codes, from 100000 to 2349999 in 2 250 000 cells, are not in the "
                               "legend 'fbfm40' (is this a culture raster?)"));
    check(64, with(tile, {"--directivity", sides, "-q"}), log);
    check(64, {"info", parcels, "--culture-legend", "fbfm40"}, log);
    check(64, {"info", parcels, "--culture-legend", "fbfm40", "--json"}, log);
    // As many as are told one by one.
    draw_cells(words, cells, GDT_Int16, [](int c, int r) { return (r * cells + c) % 16384 - 8192; });
    check(64, {"info", words, "--culture-legend", "fbfm40"}, log);
    check(64, {"info", words, words, words, words, words, "--culture-legend", "fbfm40", "--json"}, log);
    check(64, {"tile", hills, store, "--culture", words, "--culture-legend", "fbfm40", "--overwrite", "-q"}, log);
}
