// The promise of --memory, measured from outside: no command ever holds more than it and 64 MiB.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <regex>

#include "tests/drawn_raster.hpp"
#include "tests/program.hpp"

using namespace wedgescope::test;

namespace {

const std::string program = WEDGESCOPE_PROGRAM;
constexpr std::uint64_t mebibyte = std::uint64_t{1} << 20;

/// How a raster is stored.
struct Shape {
    int posts = 1024;
    GDALDataType type = GDT_Int16;
    int columns = 256, rows = 256;  ///< of a block; as wide as the raster: strips
    const char* compression = "NONE";
};

/// Hills of 10 m posts. Drawn by a process of its own: what this one once held counts as held by all it starts.
void draw_hills(const std::string& path, const Shape& shape) {
    const pid_t child = ::fork();
    if (child == 0) {
        GDALAllRegister();
        GDALSetCacheMax64(GIntBig{8} << 20);
        CPLStringList options;
        const bool tiled = shape.columns != shape.posts;
        options.SetNameValue("TILED", tiled ? "YES" : "NO");
        if (tiled) options.SetNameValue("BLOCKXSIZE", std::to_string(shape.columns).c_str());
        options.SetNameValue("BLOCKYSIZE", std::to_string(shape.rows).c_str());
        options.SetNameValue("COMPRESS", shape.compression);
        if (EQUAL(shape.compression, "ZSTD")) options.SetNameValue("ZSTD_LEVEL", "1");
        GDALDataset* out = GetGDALDriverManager()->GetDriverByName("GTiff")->Create(
            path.c_str(), shape.posts, shape.posts, 1, shape.type, options.List());
        if (!out) ::_exit(1);
        double terms[6] = {400000, 10, 0, 4500000, 0, -10};
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
                        const auto c = static_cast<std::size_t>(tx * shape.columns + x),
                                   r = static_cast<std::size_t>(ty * shape.rows + y);
                        const double z = 500 + wave[(7 * c + 3 * r) & 4095] + wave[(23 * r - 11 * c) & 4095];
                        block[at] = static_cast<float>(z);
                        whole[at] = static_cast<std::int16_t>(z);
                    }
                void* values = shape.type == GDT_Float32 ? static_cast<void*>(block.data()) : whole.data();
                if (out->GetRasterBand(1)->WriteBlock(tx, ty, values) != CE_None) ::_exit(1);
            }
        GDALClose(out);
        ::_exit(0);
    }
    int status = 0;
    if (child < 0 || ::waitpid(child, &status, 0) != child || status != 0)
        throw std::runtime_error("cannot draw " + path);
}

/// Runs the program with a budget.
Ended with_memory(std::uint64_t mib, std::vector<std::string> words, const std::string& log) {
    words.insert(words.begin(), program);
    words.insert(words.end(), {"--memory", std::to_string(mib) + "MiB"});
    return run_program(words, log);
}

/// It ends well and holds no more than the budget and 64 MiB.
void check(std::uint64_t mib, const std::vector<std::string>& words, const std::string& log) {
    const Ended ended = with_memory(mib, words, log);
    std::string line;
    for (const std::string& word : words) line += word + " ";
    INFO(line << mib << " MiB\n" << ended.err);
    CHECK(ended.code == 0);
    CHECK(ended.peak_rss_bytes <= (mib + 64) * mebibyte);
}

/// It is refused in one line within the budget; what that line names will do, and one MiB less is refused too.
void check_refused(std::uint64_t mib, const std::vector<std::string>& words, const std::string& log) {
    const Ended refused = with_memory(mib, words, log);
    std::string line;
    for (const std::string& word : words) line += word + " ";
    INFO(line << mib << " MiB\n" << refused.err);
    CHECK(refused.code == 2);
    CHECK(refused.peak_rss_bytes <= (mib + 64) * mebibyte);
    CHECK(std::count(refused.err.begin(), refused.err.end(), '\n') == 1);
    std::smatch least;
    const std::regex number("needs at least ([0-9]+) MiB");
    REQUIRE(std::regex_search(refused.err, least, number));
    const std::uint64_t enough = std::stoull(least[1].str());
    check(enough, words, log);
    const Ended less = with_memory(enough - 1, words, log);
    INFO(enough - 1 << " MiB: " << less.err);
    CHECK(less.code == 2);
    CHECK(less.peak_rss_bytes <= (enough - 1 + 64) * mebibyte);
}

std::vector<std::string> joined(std::vector<std::string> words, const std::vector<std::string>& more) {
    words.insert(words.end(), more.begin(), more.end());
    return words;
}

}  // namespace

TEST_CASE("no command holds more than --memory and 64 MiB, on a raster ten times as large", "[memory]") {
    const Folder folder;
    const std::string hills = folder / "hills.tif";
    draw_hills(hills, {.posts = 18400});  // 646 MiB
    const std::string log = folder / "log";
    const std::vector<std::string> place = {"--xy", "492000,4408000", "--altitude-agl", "900m", "--overwrite", "-q"};
    const std::vector<std::string> simulate =
        joined({"simulate", "--dem", hills, "--azimuth-bins", "480", "--range-bin", "150m", "-o", folder / "scope.png"},
               place);
    const std::vector<std::string> far = joined(simulate, {"--range", "45km"}),
                                   near = joined(simulate, {"--range", "25km"});
    for (const char* threads : {"1", "2"}) check(64, joined(far, {"--threads", threads, "--size", "512"}), log);
    check(128, joined(far, {"--no-cull", "--wedges", "3", "--size", "512"}), log);
    check(96,
          joined(far, {"--echo", folder / "echo.tif", "--power", folder / "power.tif", "--states",
                       folder / "states.tif", "--size", "2500", "--noise", "on", "--speckle", "3"}),
          log);
    check(64,
          joined(near, {"--source", "spilled", "--work-dir", folder / "work", "--temp-dir", folder / ".", "--report",
                        folder / "report.json"}),
          log);
    std::ostringstream report;
    report << std::ifstream(folder / "report.json").rdbuf();
    std::smatch spilled;
    const std::string all = report.str();
    REQUIRE(std::regex_search(all, spilled, std::regex("\"spilled_bytes\": ([0-9]+)")));
    CHECK(std::stoull(spilled[1].str()) > 16 * mebibyte);
    std::vector<std::string> plan = joined({"info", "--plan", "--dem", hills, "--range", "45km"}, place);
    std::erase(plan, "--overwrite");
    check(64, plan, log);
    check(64, {"info", hills}, log);
    for (const std::uint64_t memory : {64, 256})
        check(memory, joined({"coverage", hills, folder / "seen.tif", "--threads", "2"}, place), log);
    check(128, joined({"coverage", hills, folder / "seen.tif", "--layer", "height", "--range", "25km"}, place), log);
}

TEST_CASE("rasters of large blocks keep to --memory too", "[memory]") {
    const Folder folder;
    const std::string log = folder / "log";
    const std::vector<std::string> place = {"--xy", "424000,4476000", "--altitude-agl", "2km", "--overwrite", "-q"};
    const auto coverage = [&](const std::string& raster) {
        return joined({"coverage", raster, folder / "seen.tif", "--threads", "2"}, place);
    };
    const auto simulate = [&](const std::string& raster, const std::string& source) {
        return joined({"simulate", "--dem", raster, "--source", source, "--range", "12km", "--range-bin", "100m", "-o",
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
    check(64, {"tile", tiles, store, "--tile-size", "512", "--overwrite", "-q", "--threads", "2"}, log);
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
    for (const std::uint64_t memory : {2, 40})
        check_refused(memory, joined(simulate(lines, "422000,4478000"), {"--range", "30km"}), log);
    check_refused(2,
                  {"coverage", lines, folder / "seen.tif", "--xy", "422000,4478000", "--altitude-agl", "900m", "-q",
                   "--overwrite"},
                  log);
}
