// coverage beside Debian's gdal_viewshed, both given the same words on the same terrain.
#include <catch2/catch.hpp>

#include <cmath>
#include <cstdio>
#include <map>
#include <regex>
#include <set>

#include "tests/drawn_raster.hpp"
#include "tests/json.hpp"
#include "tests/program.hpp"

using namespace wedgescope::test;

namespace {

const std::string dem = WEDGESCOPE_DATA "/inland_empire_dem.tif";

/// A mask, and where it lies.
struct Mask {
    int columns = 0, rows = 0;
    std::array<double, 6> terms{};
    bool no_data = false;  ///< declared
    double no_data_value = 0;
    std::vector<std::uint8_t> posts;

    explicit Mask(const std::string& path) {
        GDALAllRegister();
        GDALDataset* in = GDALDataset::Open(path.c_str());
        if (!in) throw std::runtime_error("cannot open " + path);
        columns = in->GetRasterXSize();
        rows = in->GetRasterYSize();
        in->GetGeoTransform(terms.data());
        posts.resize(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
        GDALRasterBand* band = in->GetRasterBand(1);
        int declared = 0;
        no_data_value = band->GetNoDataValue(&declared);
        no_data = declared != 0;
        const CPLErr read = band->RasterIO(GF_Read, 0, 0, columns, rows, posts.data(), columns, rows, GDT_Byte, 0, 0);
        GDALClose(in);
        if (read != CE_None) throw std::runtime_error("cannot read " + path);
    }
    std::uint8_t at(int column, int row) const {
        return posts[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                     static_cast<std::size_t>(column)];
    }
};

/// The masks of both programs for the same words.
struct Pair {
    Mask theirs, ours;
};
Pair both(const Folder& folder, std::vector<std::string> words, const std::string& terrain = dem) {
    const auto run = [&](std::vector<std::string> program, const std::string& out) {
        program.insert(program.end(), words.begin(), words.end());
        program.insert(program.end(), {"-q", terrain, out});
        const Ended ended = run_program(program, folder / "log");
        INFO(ended.err);
        REQUIRE(ended.code == 0);
        return Mask(out);
    };
    std::filesystem::remove(folder / "ours.tif");
    return {run({GDAL_VIEWSHED}, folder / "theirs.tif"), run({WEDGESCOPE_PROGRAM, "coverage"}, folder / "ours.tif")};
}

/// Posts that one kind of value covers in `theirs` or `ours`, of the posts that `theirs` has.
struct Agreement {
    std::size_t posts = 0, same = 0, range_differs = 0;
    std::map<int, std::size_t> theirs, ours;
    double percent() const { return 100.0 * static_cast<double>(same) / static_cast<double>(posts); }
};
/// gdal_viewshed cuts its output to the square round the disc; ours keeps the terrain's grid, all outside beyond.
Agreement compare(const Pair& pair, int outside) {
    const auto& [theirs, ours] = pair;
    const int left = static_cast<int>(std::lround((theirs.terms[0] - ours.terms[0]) / ours.terms[1])),
              top = static_cast<int>(std::lround((theirs.terms[3] - ours.terms[3]) / ours.terms[5]));
    Agreement found;
    for (int r = 0; r < ours.rows; ++r)
        for (int c = 0; c < ours.columns; ++c) {
            const int x = c - left, y = r - top, b = ours.at(c, r);
            const bool covered = x >= 0 && x < theirs.columns && y >= 0 && y < theirs.rows;
            const int a = covered ? theirs.at(x, y) : outside;
            found.range_differs += (a == outside) != (b == outside);
            ++found.theirs[a];
            ++found.ours[b];
            found.posts += a != outside || covered;
            found.same += covered && a == b;
        }
    return found;
}

std::string said_by(const std::string& command) {
    FILE* pipe = ::popen((command + " 2>&1").c_str(), "r");
    if (!pipe) throw std::runtime_error("cannot start " + command);
    std::string all;
    for (int c = 0; (c = std::fgetc(pipe)) != EOF;) all += static_cast<char>(c);
    ::pclose(pipe);
    return all;
}

std::set<std::string> single_dash_words(const std::string& page) {
    std::set<std::string> found;
    const std::regex word(R"((^|[\s\[])(-[a-z][a-z_]*))");
    for (std::sregex_iterator at(page.begin(), page.end(), word), end; at != end; ++at) found.insert((*at)[2].str());
    return found;
}

}  // namespace

TEST_CASE("coverage marks the posts that gdal_viewshed marks, with the same words", "[viewshed]") {
    const Folder folder;
    for (const char* height : {"30", "500"}) {
        INFO("observer " << height << " m above ground");
        const Pair pair =
            both(folder, {"-ox", "453717", "-oy", "3740093", "-oz", height, "-tz", "2", "-vv", "200", "-iv", "50"});
        CHECK(pair.ours.columns == pair.theirs.columns);
        CHECK(pair.ours.rows == pair.theirs.rows);
        CHECK(pair.ours.terms == pair.theirs.terms);
        CHECK(pair.ours.no_data == pair.theirs.no_data);
        const Agreement found = compare(pair, 0);
        CHECK(found.percent() > 97);
        for (const auto* values : {&found.theirs, &found.ours}) {
            REQUIRE(values->size() == 2);
            CHECK(values->contains(50));
            CHECK(values->contains(200));
        }
    }
}

TEST_CASE("gdal_viewshed's numbers are in the units of a raster in feet", "[viewshed]") {
    const Folder folder;
    const std::string feet = folder / "feet.tif";
    constexpr double foot_m = 1200.0 / 3937;
    // The shipped terrain, its heights and posts told in feet.
    GDALAllRegister();
    GDALDataset* metric = GDALDataset::Open(dem.c_str());
    REQUIRE(metric);
    Drawing drawing;
    drawing.columns = metric->GetRasterXSize();
    drawing.rows = metric->GetRasterYSize();
    std::vector<float> heights_m(static_cast<std::size_t>(drawing.columns) * static_cast<std::size_t>(drawing.rows));
    const CPLErr read =
        metric->GetRasterBand(1)->RasterIO(GF_Read, 0, 0, drawing.columns, drawing.rows, heights_m.data(),
                                           drawing.columns, drawing.rows, GDT_Float32, 0, 0);
    GDALClose(metric);
    REQUIRE(read == CE_None);
    drawing.value = [&](int column, int row) {
        return static_cast<double>(heights_m[static_cast<std::size_t>(row) * static_cast<std::size_t>(drawing.columns) +
                                             static_cast<std::size_t>(column)]) /
               foot_m;
    };
    drawing.geotransform = std::array<double, 6>{6500000, 30 / foot_m, 0, 1900000, 0, -30 / foot_m};
    drawing.crs = "EPSG:2229";
    drawing.unit = "US survey foot";
    draw(feet, drawing);
    // A hundred feet above ground, six of a man, three miles; the curvature of both is not alike in feet.
    const std::vector<std::string> words = {"-ox", "6549000", "-oy", "1850000", "-oz", "100", "-tz", "6",
                                            "-md", "15840",   "-cc", "0",       "-vv", "200", "-iv", "50"};
    const Pair pair = both(folder, words, feet);
    const Agreement found = compare(pair, 0);
    CHECK(found.percent() > 97);
    CHECK(found.range_differs < found.posts / 200);
    const auto scene_of = [&](std::vector<std::string> given) {
        given.insert(given.begin(), {WEDGESCOPE_PROGRAM, "coverage", feet, folder / "out.tif", "--overwrite", "-q",
                                     "--report", folder / "report.json"});
        const Ended ended = run_program(given, folder / "log");
        INFO(ended.err);
        REQUIRE(ended.code == 0);
        return json_in(folder / "report.json")["scene"];
    };
    const auto metres = [](const nlohmann::json& value) { return std::stod(value.get<std::string>()); };
    const auto scene = scene_of(words);
    CHECK(metres(scene["altitude-agl"]) == Approx(100 * foot_m));
    CHECK(metres(scene["target-height"]) == Approx(6 * foot_m));
    CHECK(metres(scene["ground-range"]) ==
          Approx(15840 * foot_m * (scene["ground-range"].get<std::string>().ends_with("km") ? 1e-3 : 1)));
    // Its default of 2 as well, but nothing that has a unit of its own.
    CHECK(metres(scene_of({"-ox", "6549000", "-oy", "1850000"})["altitude-agl"]) == Approx(2 * foot_m));
    CHECK(scene_of({"-ox", "6549000", "-oy", "1850000", "--altitude-agl", "50m", "--ground-range",
                    "900m"})["altitude-agl"] == "50m");
    CHECK(scene_of({"-ox", "6549000", "-oy", "1850000", "--altitude-msl", "3km"})["altitude-msl"] == "3km");
}

TEST_CASE("gdal_viewshed's -md is a distance along the ground, however high the observer", "[viewshed]") {
    const Folder folder;
    for (const char* height : {"20", "9000"})
        for (const char* distance : {"4000", "10000"}) {
            INFO("observer " << height << " m above ground, " << distance << " m");
            const Pair pair = both(folder, {"-ox", "453000", "-oy", "3740000", "-oz", height, "-md", distance, "-vv",
                                            "200", "-iv", "50", "-ov", "7"});
            const Agreement found = compare(pair, 7);
            CHECK(found.range_differs == 0);
            CHECK(found.percent() > 97);
            CHECK(found.ours.at(200) > 1000);
        }
}

TEST_CASE("what is out of range and what is hidden stay apart from no-data, as in gdal_viewshed's masks",
          "[viewshed]") {
    const Folder folder;
    const std::vector<std::string> words = {"-ox", "453717", "-oy", "3740093", "-oz", "30", "-md", "6000"};
    const Pair plain = both(folder, words);
    CHECK_FALSE(plain.theirs.no_data);
    CHECK_FALSE(plain.ours.no_data);
    CHECK(compare(plain, 0).ours.size() == 2);
    std::vector<std::string> declared = words;
    declared.insert(declared.end(), {"-a_nodata", "17"});
    const Pair named = both(folder, declared);
    CHECK(named.theirs.no_data_value == 17);
    CHECK(named.ours.no_data_value == 17);
    CHECK(named.ours.no_data == named.theirs.no_data);
}

TEST_CASE("the help names every option that gdal_viewshed has", "[viewshed]") {
    const std::set<std::string> theirs = single_dash_words(said_by(GDAL_VIEWSHED " --help")),
                                ours = single_dash_words(said_by(WEDGESCOPE_PROGRAM " help coverage"));
    CHECK(theirs.size() > 12);
    for (const std::string& option : theirs) {
        INFO(option);
        CHECK(ours.contains(option));
    }
}
