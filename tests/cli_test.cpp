// What the built program says: its help, one line and an exit code for whatever it refuses, and remarks.
// Leaves what a run reads to cli_inputs.cpp, what it writes to cli_outputs.cpp, the spilled source to cli_spilled.cpp,
// and what ends a run too soon to cli_ends.cpp.
#include <catch2/catch.hpp>

#include <limits>
#include <string>
#include <vector>

#include "tests/cli.hpp"
#include "tests/json.hpp"

using namespace wedgescope::test;
using namespace wedgescope::test::cli;
using Catch::Matchers::Contains;

TEST_CASE("help and version go to stdout", "[cli]") {
    const Folder folder;
    CHECK_THAT(folder.run({"--version"}).out,
               Contains("wedgescope 0.") && Contains("GDAL 3") && Contains("TBB") && Contains("instruction set "));
    for (const Strings& arguments : {Strings{"help"}, {"--help"}, {"-h"}}) {
        const Outcome outcome = folder.run(arguments);
        CHECK(outcome.code == 0);
        CHECK_THAT(outcome.out, Contains("simulate") && Contains("info") && Contains("WEDGESCOPE_TARGET"));
        CHECK(outcome.err.empty());
    }
    for (const Strings& arguments : {Strings{"help", "simulate"}, {"simulate", "--help"}, {"simulate", "-h"}}) {
        const Outcome outcome = folder.run(arguments);
        CHECK(outcome.code == 0);
        CHECK_THAT(outcome.out, Contains("--transmit-power POWER") && Contains("[50kW]") && Contains("nmi"));
        CHECK(outcome.err.empty());
    }
    CHECK_THAT(folder.run({"help", "info"}).out, Contains("--json"));
}

TEST_CASE("a wrong command or option costs one line and exit code 2", "[cli][long]") {
    const Folder folder;
    refuses(folder, {}, 2, {"no command"});
    refuses(folder, {"coverage"}, 2, {"coverage takes two paths"});
    refuses(folder, {"simulat"}, 2, {"did you mean simulate?"});
    refuses(folder, {"--dem", dem}, 2, {"--dem"});
    refuses(folder, {"help", "view"}, 2, {"unknown command 'view'"});
    refuses(folder, with(with(good, out), {"--rang", "5km"}), 2, {"--rang", "did you mean --range?"});
    refuses(folder, with(with(good, out), {"--rain", "on"}), 2, {"--rain"});
    refuses(folder, with(with(good, out), {"--pulse", "2.4"}), 2, {"--pulse is '2.4'", "s, ms, us, ns"});
    refuses(folder, with(with(good, out), {"--pulse", "2.4m"}), 2, {"unknown unit 'm'", "s, ms, us, ns"});
    refuses(folder, with(with(good, out), {"--pulse", "2,4us"}), 2, {"--pulse is '2,4us'"});
    refuses(folder, with(with(good, out), {"--pulse"}), 2, {"--pulse needs a value"});
    refuses(folder, with(with(good, out), {"--gain", "nandB"}), 2, {"--gain"});
    refuses(folder, good, 2, {"no output"});
    refuses(folder, {"info"}, 2, {"path"});
}

TEST_CASE("coverage understands gdal_viewshed's options", "[cli][long]") {
    const Folder folder;
    const Strings place = {"-ox", "453717", "-oy", "3740093", "-oz", "100"};
    const auto report_of = [&](const Strings& options) {
        const Outcome outcome = folder.run(
            with({"coverage", dem, "seen.tif", "--overwrite", "--report", "seen.json"}, with(place, options)));
        INFO(outcome.err);
        REQUIRE(outcome.code == 0);
        return json_in(folder.file("seen.json"));
    };
    const auto plain = report_of({});
    CHECK(plain["scene"]["geometry"] == "grid");
    CHECK(plain["scene"]["altitude-agl"] == "100m");
    CHECK(plain["scene"]["outside-value"] == "0");
    // K R1 = a / cc
    CHECK(std::stod(plain["scene"]["earth"].get<std::string>()) * 0.85714 * 6371008.7714 ==
          Approx(6378137).epsilon(1e-9));
    const auto all =
        report_of({"-tz", "3.5",       "-md", "9000", "-cc", "0",  "-ov",   "9",   "-vv",          "200", "-iv",
                   "100", "-a_nodata", "17",  "-b",   "1",   "-f", "GTiff", "-co", "COMPRESS=LZW", "-om", "NORMAL"});
    CHECK(all["scene"]["target-height"] == "3.5m");
    CHECK(all["scene"]["ground-range"] == "9km");
    CHECK(all["scene"]["range"] == "auto");
    CHECK(all["scene"]["earth"] == "flat");
    CHECK(all["scene"]["outside-value"] == "9");
    CHECK(all["scene"]["seen-value"] == "200");
    CHECK(all["scene"]["hidden-value"] == "100");
    CHECK(all["scene"]["no-data-value"] == "17");
    fs::remove(folder.file("seen.tif"));
    fs::remove(folder.file("seen.json"));
    const Strings run = {"coverage", dem, "x.tif"};
    refuses(folder, with(run, {"-ox", "453717"}), 2, {"-oy is missing"});
    refuses(folder, with(run, {"-ox", "east", "-oy", "3740093"}), 2, {"-ox is 'east'"});
    refuses(folder, with(run, with(place, {"-b", "2"})), 2, {"-b is '2'"});
    refuses(folder, with(run, with(place, {"-om", "DEM"})), 2, {"-om is 'DEM'", "--layer height", "above the ground"});
    refuses(folder, with(run, with(place, {"-om", "GROUND"})), 2, {"-om is 'GROUND'", "--layer height gives what"});
    refuses(folder, with(run, with(place, {"-om", "BOTH"})), 2, {"-om is 'BOTH'; it must be NORMAL"});
    refuses(folder, with(run, with(place, {"-vv", "300"})), 2, {"-vv is '300'", "255"});
    refuses(folder, with(run, with(place, {"-oz"})), 2, {"-oz"});
    refuses(folder, {"coverage", dem, " ", "--xy", "453717,3740093", "--altitude-agl", "100m"}, 2,
            {"nothing but blanks"});
    // What is auto is as if nobody had said it; a table of materials is for the response.
    const Strings stands = {"--xy", "453717,3740093", "--altitude-agl", "100m", "--range", "3km"};
    CHECK(
        folder.run(with({"coverage", dem, "seen.tif", "--seen-value", "1", "--no-data-value", "auto"}, stands)).code ==
        0);
    fs::remove(folder.file("seen.tif"));
    const std::string classes = folder.write("classes.csv", content(data + "/../../docs/classes.csv"));
    refuses(folder, with(with(run, stands), {"--class-table", classes}), 2,
            {"--class-table is given", "layer response alone"});
    refuses(folder, {"coverage", data + "/N44W072.hgt", "x.tif", "-ox", "-71.5", "-oy", "44.5"}, 2,
            {"geodesic", "-ox and -oy", "is in degrees; add --geometry geodesic"});
}

TEST_CASE("a scene that contradicts itself or says too little is refused", "[cli][long]") {
    const Folder folder;
    const Strings start = {"simulate", "-o", "scope.png", "--dem", dem};
    const Strings place = {"--latlon", "33.93,-117.33"}, height = {"--altitude-msl", "7000ft"};
    refuses(folder, with(with(start, place), with(height, {"--range", "0"})), 2, {"--range", "above 0m"});
    refuses(folder, with(with(start, place), with(height, {"--range", "5km", "--range-start", "6km"})), 2,
            {"range-start"});
    refuses(folder, with(start, height), 2, {"latlon", "xy"});
    refuses(folder, with(with(start, place), with(height, {"--xy", "465000,3750000"})), 2, {"latlon", "xy"});
    refuses(folder, with(start, place), 2, {"altitude-msl"});
    refuses(folder, with(with(start, place), with(height, {"--altitude-agl", "1km"})), 2, {"altitude-agl"});
    refuses(folder, with(with(start, place), {"--altitude-hae", "1km"}), 2, {"geoid-offset"});
    refuses(folder, {"simulate", "-o", "scope.png", "--latlon", "33.93,-117.33", "--altitude-msl", "7000ft"}, 2,
            {"dem"});
    refuses(folder, with(with(start, place), with(height, {"--culture", data + "/inland_empire_culture.tif"})), 2,
            {"culture-legend"});
    const Strings whole = with(with(start, place), height);
    refuses(folder, with(with(start, place), {"--altitude-agl", "999.9km"}), 2, {"altitude is 1000", "within 1000 km"});
    refuses(folder, with(with(start, place), {"--altitude-msl", "9km", "--earth", "0.5", "--range", "9900km"}), 2,
            {"range is 9900000 m", "on this earth"});
    refuses(folder, with(whole, {"--water", "calm", "--sea-state", "3"}), 2,
            {"sea-state is 3", "water calm", "water nrl"});
    refuses(folder, with(whole, {"--water", "calm", "--wind-direction", "10deg"}), 2,
            {"wind-direction is 10 deg", "water calm"});
    refuses(folder, with(whole, {"--gamma", "-15dB", "--far-shore", "on"}), 2, {"far-shore is given with gamma"});
    refuses(folder, with(whole, {"--far-shore", "on", "--frequency", "94GHz"}), 2,
            {"frequency with far-shore is 94 GHz", "at most 40"});
    refuses(folder, with(whole, {"--backscatter", "oh", "--frequency", "35GHz"}), 2, {"backscatter oh: ", "35 GHz"});
    refuses(folder, with(whole, {"--sea-state", "3", "--frequency", "94GHz"}), 2, {"sea-state: ", "94 GHz"});
    refuses(folder, with(whole, {"--water", "calm", "--frequency", "94GHz"}), 2, {"water calm: ", "94 GHz"});
    refuses(folder, with(whole, {"--wind-direction", "361deg"}), 2,
            {"--wind-direction is '361deg'", "from -360deg to 360deg"});
    const std::string twice = folder.write("twice.ini", "range = 5km\nlatlon = 1,2\nxy = 1,2\n");
    refuses(folder, {"simulate", twice, "-o", "scope.png"}, 2, {"line 3", "latlon"});
    const std::string unknown = folder.write("unknown.ini", "dem = x.tif\nfrequenzy = 5GHz\n");
    refuses(folder, {"simulate", unknown, "-o", "scope.png"}, 2, {"line 2", "'frequenzy'", "did you mean frequency?"});
    refuses(folder, {"simulate", "nowhere.ini", "-o", "scope.png"}, 1, {"nowhere.ini"});
    refuses(folder, {"simulate", data + "/inland_empire_culture.tif", "-o", "scope.png"}, 2,
            {"inland_empire_culture.tif' is no text", "key = value"});
}

TEST_CASE("latitude and longitude the wrong way round are asked about where that would help", "[cli][long]") {
    const Folder folder;
    const std::string hills = data + "/N44W072.hgt";
    const auto with_place = [&](const std::string& place, const char* altitude) {
        return Strings{"coverage", hills, "seen.tif", "--range", "1km",
                       "--latlon", place, altitude,   "1km",     "--overwrite"};
    };
    refuses(folder, with_place("-71.5,44.5", "--altitude-agl"), 2, {"outside the raster", "(LAT,LON swapped?)"});
    CHECK_THAT(folder.run(with_place("-71.5,44.5", "--altitude-msl")).err,
               Contains("outside the terrain raster (LAT,LON swapped?)"));
    for (const char* elsewhere : {"44.5,-71.5", "-71.5,45.5", "45.5,-71.5"})
        CHECK_THAT(folder.run(with_place(elsewhere, "--altitude-msl")).err, !Contains("swapped"));
    const auto with_xy = [&](const std::string& place) {
        return Strings{"coverage", hills, "seen.tif",       "--range", "1km",
                       "--xy",     place, "--altitude-msl", "1km",     "--overwrite"};
    };
    CHECK_THAT(folder.run(with_xy("44.5,-71.5")).err, Contains("(X,Y swapped?)"));
    for (const char* elsewhere : {"-71.5,44.5", "45.5,-71.5", "-71.5,45.5"})
        CHECK_THAT(folder.run(with_xy(elsewhere)).err, !Contains("swapped"));
}

TEST_CASE("a temp-dir that is none is refused at once, needed or not", "[cli]") {
    const Folder folder;
    folder.write("file", "x");
    const Strings place = {"--latlon", "33.93,-117.33", "--altitude-msl", "7000ft"};
    for (const auto& [path, why] :
         {std::pair<const char*, const char*>{"missing", "No such file or directory"}, {"file", "it is no folder"}}) {
        const Strings more = {"--temp-dir", path};
        const Strings words = {"temp-dir '" + std::string(path) + "' cannot be used: ", why, "accepted: a folder"};
        refuses(folder, with(with(good, out), more), 1, words);
        refuses(folder, with(with({"coverage", dem, "seen.tif"}, place), more), 1, words);
        // Of another machine, maybe.
        CHECK(folder.run(with(with({"info", "--plan", "--dem", dem}, place), more)).code == 0);
    }
}

TEST_CASE("a raster that cannot be used is named", "[cli]") {
    const Folder folder;
    const Strings rest = {"--latlon", "33.93,-117.33", "--altitude-msl", "7000ft", "-o", "scope.png"};
    const auto use = [&](const std::string& path) { return with({"simulate", "--dem", path}, rest); };
    refuses(folder, use("nowhere.tif"), 1, {"nowhere.tif"});
    refuses(folder, use(folder.write("words.tif", "these are words\n")), 1, {"words.tif"});
    refuses(folder, use(folder.write("empty.tif", "")), 1, {"empty.tif"});
    refuses(folder, use(folder.write("cut.tif", content(dem).substr(0, 800000))), 1, {"cut.tif"});
    refuses(folder, {"info", "nowhere.tif"}, 1, {"nowhere.tif"});
    refuses(folder, {"info", folder.file("cut.tif")}, 1, {"cut.tif"});
    refuses(folder, {"info", folder.file("words.tif")}, 1, {"words.tif"});

    const Strings at = {"--xy", "465100,3750100", "--altitude-msl", "500m", "-o", "scope.png"};
    refuses(folder, with({"simulate", "--dem", grid(folder, "one", "5", true, 1, 1)}, at), 1, {"one.asc"});
    const std::string bare = grid(folder, "bare", "5", false);
    refuses(folder, with({"simulate", "--geometry", "geodesic", "--dem", bare}, at), 2,
            {"geometry", "bare.asc", "CRS"});
    refuses(folder,
            with({"simulate", "--dem", bare}, {"--latlon", "33.9,-117.4", "--altitude-msl", "1km", "-o", "scope.png"}),
            2, {"latlon", "bare.asc"});

    std::vector<float> posts(100, 5.0f);
    posts[37] = std::numeric_limits<float>::infinity();
    refuses(folder, with({"simulate", "--dem", float_raster(folder, "infinite", 10, 10, posts)}, at), 1,
            {"infinite.dat", "7", "3"});
    posts[37] = 2e5f;
    refuses(folder, with({"simulate", "--dem", float_raster(folder, "high", 10, 10, posts)}, at), 1,
            {"high.dat", "7", "3"});
    posts.assign(100, std::numeric_limits<float>::quiet_NaN());
    refuses(folder,
            with({"simulate", "--altitude-agl", "1km", "--dem", float_raster(folder, "void", 10, 10, posts)},
                 {"--xy", "465100,3750100", "-o", "scope.png"}),
            2, {"altitude-agl", "void"});
}

TEST_CASE("culture must lie on the terrain and be known by its legend", "[cli]") {
    const Folder folder;
    const std::string ground = grid(folder, "ground", "5");
    const Strings start = {"simulate", "--dem",   ground, "--xy", "465150,3750120", "--altitude-msl",
                           "500m",     "--range", "1km",  "-o",   "scope.png"};
    const std::string far = grid(folder, "far", "91", true, 10, 8, 600000);
    refuses(folder, with(start, {"--culture", far, "--culture-legend", "fbfm40"}), 1, {"far.asc"});
    const std::string odd = grid(folder, "odd", "77");
    refuses(folder, with(start, {"--culture", odd, "--culture-legend", "fbfm40"}), 1, {"77", "legend"});
    refuses(folder, with(start, {"--culture", odd, "--culture-legend", "nowhere.csv"}), 1, {"nowhere.csv"});
    const std::string legend = folder.write("legend.csv", "code,material\n77,cheese\n");
    refuses(folder, with(start, {"--culture", odd, "--culture-legend", legend}), 2, {"legend.csv", "cheese"});
    folder.write("legend.csv", "code,material\n77,suburban\n");
    CHECK(folder.run(with(start, {"--culture", odd, "--culture-legend", legend})).code == 0);
}

TEST_CASE("the sensor stands above ground, wherever it is", "[cli]") {
    const Folder folder;
    const Strings start = {"simulate", "--dem", dem, "-o", "scope.png", "--size", "200", "--range", "10km"};
    refuses(folder, with(start, {"--latlon", "33.93,-117.33", "--altitude-msl", "100m"}), 2, {"below", "m"});
    refuses(folder, with(start, {"--latlon", "35,-117.33", "--altitude-agl", "100m"}), 2, {"altitude-agl", "outside"});
    const Outcome outside = folder.run(with(start, {"--latlon", "34.04,-117.33", "--altitude-msl", "3km"}));
    CHECK(outside.code == 0);
    CHECK_THAT(outside.err, Contains("outside the terrain raster"));
    CHECK(folder.names().contains("scope.png"));
    // The raster's edge lies half a cell beyond the outermost posts, where there is no terrain: not a void.
    refuses(folder, {"coverage", "--xy", "453732.926,3764090", "--altitude-agl", "30m", dem, "seen.tif"}, 2,
            {"altitude-agl", "row -0.4", "beyond its outermost posts"});
}

TEST_CASE("an output without a name is refused before any work", "[cli][long]") {
    const Folder folder;
    const std::string ground = grid(folder, "ground", "5");
    refuses(folder, {"tile", ground, ""}, 2, {"output has an empty name", "folder"});
    refuses(folder, {"tile", ground, "", "--overwrite"}, 2, {"output has an empty name"});
    refuses(folder, {"tile", ground, "", "--resume"}, 2, {"output has an empty name"});
    refuses(folder, {"coverage", ground, "", "--xy", "465100,3750100", "--altitude-agl", "1km"}, 2,
            {"output has an empty name"});
    for (const char* key : {"--output", "--echo", "--power", "--states", "--report", "--timeline", "--work-dir"}) {
        refuses(folder, with(good, {key, ""}), 2, {key, "is empty"});
        refuses(folder, with(good, {std::string(key) + "= "}), 2, {key, "is empty"});
    }
}

TEST_CASE("what may look like an error of the program is explained", "[cli][long]") {
    const Folder folder;
    const Strings scene{"simulate", "--dem", dem, "--size", "64", "-o", "s.png", "--overwrite"};
    const auto says = [&](const Strings& more, const std::string& what) {
        const Outcome outcome = folder.run(with(scene, more));
        CHECK(outcome.code == 0);
        CHECK_THAT(outcome.err, Contains(what));
    };
    says({"--latlon", "33.8,60", "--altitude-msl", "9km", "--range", "40km"}, "nothing of the terrain lies within");
    says({"--latlon", "33.8,-117.4", "--altitude-msl", "30km", "--range", "60km"}, "if-gain");
    says({"--latlon", "33.8,-117.4", "--altitude-msl", "3km", "--range", "20km", "--azimuth-bins", "60"},
         "wider than half the beam");
    const Strings place{"--latlon", "33.8,-117.4", "--altitude-msl", "3km", "--range", "6km"};
    says(with(place, {"--wind-direction", "30deg"}), "wind-direction has no effect: it is that of waves");
    says(with(place, {"--geoid-offset", "-30m"}), "geoid-offset has no effect: it brings altitude-hae to sea level");
    says(with(place, {"--rain", "light", "--frequency", "95GHz"}),
         "rain: its own echo is Rayleigh's, good to Ku band and fair to 35 GHz; at 95 GHz it is too strong");
    says(with(place, {"--rain", "25mm/h", "--frequency", "32GHz"}),
         "good to Ku band; at 32 GHz in 25 mm/h it is too strong");
    says(with(place, {"--far-shore", "on"}), "far-shore has no effect: water is told from land by culture");
    says(with(place, {"--sea-state", "3", "--wind-direction", "30deg"}),
         "sea-state and wind-direction have no effect: no ground is of a class of water, by culture or material");
    says(with(place, {"--water", "calm"}), "water has no effect: no ground is of a class of water");
    says(with(place, {"--walls", "statistical"}), "walls statistical has no effect: no class of the ground");
    says(with(place, {"--sea-state", "4", "--backscatter", "oh", "--gamma", "-15dB"}),
         "backscatter and sea-state have no effect: gamma is one for everything");
    says(with(place, {"--rain", "light", "--rain-top", "100m"}), "rain-top is 100 m, and the ground around lies at ");
    says(with(place, {"--cloud", "fog", "--cloud-top", "100m"}),
         "cloud-top is 100 m, and the ground below the sensor lies at ");
    says(with(place, {"--cloud", "fog", "--cloud-top", "12km"}), "cloud-top is 12000 m: above 8500 m, at -40 C");
    says(with(place, {"--rain-top", "2km"}), "rain-top has no effect without rain");
    says(with(place, {"--cloud-base", "1km", "--cloud-top", "2km"}),
         "cloud-base and cloud-top have no effect without cloud");
    says(with(place, {"--stc-exponent", "3"}), "stc-exponent has no effect without stc-range");
    says(with(place, {"--seed", "7"}), "seed has no effect without noise or speckle");
    says(with(place, {"--sweep-delay", "2km"}), "sweep-delay has no effect: it is that of display tdppi");
    says(with(place, {"--rings", "off", "--ring-spacing", "1nmi"}), "ring-spacing has no effect without rings");
    says(with(place, {"--antenna-exponent", "1"}), "antenna-exponent has no effect: it is that of antenna cos-csc2");
    says(with(place, {"--range-bin", "150m"}),
         "range bins of 150 m are longer than the pulse of 74.95 m (c tau/2): a cell is the mean over its bin, so what "
         "stands alone comes out up to 3.0 dB too weak");
    says({"--latlon", "33.8,-117.4", "--altitude-msl", "40km", "--range", "60km"},
         "the sensor is 40 km up: earth 1.333");
    std::string world = "ncols 60\nnrows 40\nxllcorner -30\nyllcorner -20\ncellsize 1\n";
    for (int row = 0; row < 40; ++row) {
        for (int column = 0; column < 60; ++column) world += "0 ";
        world += "\n";
    }
    folder.write("world.asc", world);
    folder.write("world.prj",
                 R"(GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],)"
                 R"(UNIT["degree",0.0174532925199433]])");
    CHECK_THAT(folder
                   .run({"simulate", "--dem", "world.asc", "--latlon", "0.3,0.2", "--altitude-msl", "9km", "--range",
                         "300km", "--size", "64", "-o", "w.png"})
                   .err,
               Contains("posts are 111 km apart, and between two of them the earth bulges by 18"));
    says(with(place, {"--class-table", "name,gamma10_db;tress,-14"}), "class-table adds tress, which neither");
    for (const Strings& more :
         {Strings{"--wind-direction", "30deg", "--sea-state", "2", "--material", "water"},
          Strings{"--walls", "statistical", "--material", "suburban"}, Strings{"--seed", "7", "--noise", "on"},
          Strings{"--ring-spacing", "1nmi"}, Strings{"--display", "tdppi", "--sweep-delay", "2km"},
          Strings{"--antenna", "cos-csc2", "--antenna-exponent", "1"},
          Strings{"--class-table", "name,gamma10_db;Soil,-14"},
          Strings{"--class-table", "name,gamma10_db;corn,-14", "--material", "corn"}})
        CHECK(folder.run(with(scene, with(place, more))).error_lines() == 2);
    const Outcome usual =
        folder.run(with(scene, {"--latlon", "33.8,-117.4", "--altitude-msl", "3km", "--range", "20km"}));
    CHECK(usual.error_lines() == 2);  // the sensor's place, and what was written
    // The tube is no matter of a run that draws none.
    const Strings layer{"simulate", "--dem", dem, "--power", "p.tif", "--overwrite", "--if-gain", "-100dB"};
    CHECK(folder.run(with(layer, place)).error_lines() == 2);
}

TEST_CASE("tile refuses wrong options and rasters in one line, and leaves nothing", "[cli][long]") {
    const Folder folder;
    const std::string a = grid(folder, "a", "5");
    refuses(folder, {"tile"}, 2, {"at least one terrain raster", "0 paths"});
    refuses(folder, {"tile", a}, 2, {"at least one terrain raster", "1 path"});
    refuses(folder, {"tile", a, "store", "--tile-size", "100"}, 2, {"tile-size", "100", "64, 128, 256"});
    refuses(folder, {"tile", a, "store", "--memory", "1MiB"}, 2, {"memory", "1"});
    refuses(folder, {"tile", a, "store", "--memory", "1kB"}, 2, {"memory is 1000 bytes"});
    refuses(folder, {"tile", "none.store", "--around", "33.8,-117.4"}, 2,
            {"'none.store' is no tile store", "or terrain"});
    refuses(folder, {"tile", a, "store", "--co", "TILED=NO"}, 2, {"TILED=NO", "tile-size"});
    refuses(folder, {"tile", a, "store", "--around", "91,0"}, 2, {"around", "LAT,LON", "-90 to 90"});
    refuses(folder, {"tile", a, "store", "--around", "here"}, 2, {"around", "here"});
    refuses(folder, {"tile", a, "store", "--culture-legend", "nlcd"}, 2, {"culture-legend", "no culture"});
    refuses(folder, {"tile", a, "store", "--range", "3km"}, 2, {"range"});
    refuses(folder, {"tile", "none.tif", "store"}, 1, {"none.tif"});
    const std::string row = grid(folder, "row", "5", true, 10, 1);
    refuses(folder, {"tile", row, "store"}, 1, {"dem '" + row + "' has 10 x 1 posts; accepted: at least 2 x 2"});
    REQUIRE(folder.run({"tile", a, "made.store"}).code == 0);
    for (const auto& [option, value] :
         {std::pair{"--co", "COMPRESS=NONE"}, {"--tile-size", "1024"}, {"--features-touch", "on"}})
        refuses(folder, {"tile", "--around", "33.89,-117.37", option, value, "made.store"}, 2,
                {std::string(option) + " is given", "a store that stands"});
    fs::remove_all(folder.work() / "made.store");
    refuses(folder, {"info", "--plan", "--verify", "--dem", a, "--xy", "465100,3750100", "--altitude-msl", "500m"}, 2,
            {"verify is given with plan"});
    // A legend that names a class of one's own needs its table there too.
    const std::string table = content(data + "/../../docs/classes.csv") + "mine,-16,,grass,,,omni,0,,,\n";
    const Strings own = {"--class-table", folder.write("own.csv", table)};
    folder.write("legend.csv", "code,material\n1,mine\n");
    const std::string culture = grid(folder, "culture", "1");
    REQUIRE(
        folder.run(with({"tile", a, "own.store", "--culture", culture, "--culture-legend", "legend.csv"}, own)).code ==
        0);
    CHECK(folder.run(with({"tile", "--around", "33.89,-117.37", "own.store"}, own)).code == 0);
    fs::remove_all(folder.work() / "own.store");
    fs::create_directory(folder.work() / "mine");
    folder.write("mine/letter.txt", "dear");
    refuses(folder, {"tile", a, "mine"}, 2, {"'mine'", "exists", "is no tile store"});
    refuses(folder, {"tile", a, "mine", "--overwrite"}, 2, {"'mine'", "no tile store"});
    CHECK(content(folder.work() / "mine/letter.txt") == "dear");
    const std::string other = data + "/worcester_vermont_dem.tif";
    refuses(folder, {"tile", dem, other, "store"}, 1, {"worcester_vermont_dem.tif", "gdalwarp -t_srs EPSG:32611"});
}
