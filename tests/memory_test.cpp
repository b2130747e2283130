// The promise of --memory, measured from outside: no command ever holds more than it and 64 MiB.
#include <catch2/catch.hpp>
#include <cmath>
#include <regex>

#include "tests/drawn_raster.hpp"
#include "tests/program.hpp"

using namespace wedgescope::test;

namespace {

const std::string program = WEDGESCOPE_PROGRAM;
constexpr std::uint64_t mebibyte = std::uint64_t{1} << 20;

/// Hills in tiles of 256 x 256, int16, 10 m posts.
void draw_hills(const std::string& path, int posts) {
    GDALAllRegister();
    GDALSetCacheMax64(GIntBig{8} << 20);  // what a child inherits at its start counts as its own
    CPLStringList options;
    for (const char* option : {"TILED=YES", "BLOCKXSIZE=256", "BLOCKYSIZE=256", "BIGTIFF=IF_SAFER"})
        options.AddString(option);
    GDALDataset* out = GetGDALDriverManager()->GetDriverByName("GTiff")->Create(path.c_str(), posts, posts, 1,
                                                                                GDT_Int16, options.List());
    if (!out) throw std::runtime_error("cannot draw " + path);
    double terms[6] = {400000, 10, 0, 4500000, 0, -10};
    out->SetGeoTransform(terms);
    OGRSpatialReference crs;
    crs.importFromEPSG(32611);
    out->SetSpatialRef(&crs);
    std::vector<double> wave(4096);
    for (std::size_t i = 0; i < wave.size(); ++i)
        wave[i] = 220 * std::sin(static_cast<double>(i) / 4096 * 6.283185307179586);
    std::vector<std::int16_t> tile(256 * 256);
    const int tiles = (posts + 255) / 256;
    for (int ty = 0; ty < tiles; ++ty)
        for (int tx = 0; tx < tiles; ++tx) {
            for (int y = 0; y < 256; ++y)
                for (int x = 0; x < 256; ++x) {
                    const auto c = static_cast<std::size_t>(tx * 256 + x), r = static_cast<std::size_t>(ty * 256 + y);
                    tile[static_cast<std::size_t>(y * 256 + x)] =
                        static_cast<std::int16_t>(500 + wave[(7 * c + 3 * r) & 4095] + wave[(23 * r - 11 * c) & 4095]);
                }
            if (out->GetRasterBand(1)->WriteBlock(tx, ty, tile.data()) != CE_None)
                throw std::runtime_error("cannot draw " + path);
        }
    GDALClose(out);
}

}  // namespace

TEST_CASE("no command holds more than --memory and 64 MiB, on a raster ten times as large", "[memory]") {
    const Folder folder;
    const std::string hills = folder / "hills.tif";
    draw_hills(hills, 18400);  // 646 MiB
    const std::string log = folder / "log";
    const std::vector<std::string> scene = {"--dem",
                                            hills,
                                            "--xy",
                                            "492000,4408000",
                                            "--altitude-agl",
                                            "900m",
                                            "--range",
                                            "45km",
                                            "--overwrite",
                                            "-q",
                                            "--azimuth-bins",
                                            "480",
                                            "--range-bin",
                                            "150m",
                                            "-o",
                                            folder / "scope.png"};
    const auto check = [&](std::uint64_t memory_mib, std::vector<std::string> words,
                           const std::vector<std::string>& more) {
        words.insert(words.begin(), program);
        words.insert(words.end(), more.begin(), more.end());
        words.insert(words.end(), {"--memory", std::to_string(memory_mib) + "MiB"});
        const Ended ended = run_program(words, log);
        std::string line;
        for (const std::string& word : words) line += word + " ";
        INFO(line << "\n" << ended.err);
        CHECK(ended.code == 0);
        CHECK(ended.peak_rss_bytes <= (memory_mib + 64) * mebibyte);
    };
    std::vector<std::string> simulate = scene;
    simulate.insert(simulate.begin(), "simulate");
    for (const char* threads : {"1", "2"}) check(64, simulate, {"--threads", threads, "--size", "512"});
    check(128, simulate, {"--no-cull", "--wedges", "3", "--size", "512"});
    check(96, simulate,
          {"--echo", folder / "echo.tif", "--power", folder / "power.tif", "--states", folder / "states.tif", "--size",
           "2500", "--noise", "on", "--speckle", "3"});
    check(64, {"info", hills}, {});
    for (const std::uint64_t memory : {64, 256})
        check(memory,
              {"coverage", hills, folder / "seen.tif", "--xy", "492000,4408000", "--altitude-agl", "900m",
               "--overwrite", "-q", "--threads", "2"},
              {});
}

TEST_CASE("the budget that a refusal names will do", "[memory]") {
    const Folder folder;
    const std::string hills = folder / "hills.tif", log = folder / "log";
    draw_hills(hills, 1024);
    const auto simulate = [&](const std::string& memory) {
        return run_program({program, "simulate", "--dem", hills, "--xy", "405000,4495000", "--altitude-agl", "900m",
                            "--size", "3000", "-q", "--overwrite", "-o", folder / "scope.png", "--memory", memory},
                           log);
    };
    const Ended refused = simulate("16MiB");
    CHECK(refused.code == 2);
    std::smatch least;
    const std::regex number("needs at least ([0-9]+) MiB");
    REQUIRE(std::regex_search(refused.err, least, number));
    const Ended done = simulate(least[1].str() + "MiB");
    INFO(done.err);
    CHECK(done.code == 0);
    CHECK(done.peak_rss_bytes <= (std::stoull(least[1].str()) + 64) * mebibyte);
    CHECK(simulate(std::to_string(std::stoull(least[1].str()) - 1) + "MiB").code == 2);
}
