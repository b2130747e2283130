// Units, the table of keys, command line and scene file.
#include <fmt/format.h>
#include <catch2/catch.hpp>

#include <unistd.h>

#include <clocale>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <set>
#include <sstream>

#include "lib/spoke_grid.hpp"
#include "tests/refusal.hpp"
#include "tests/variable.hpp"
#include "tools/help.hpp"
#include "tools/key_commands.hpp"
#include "tools/key_file.hpp"
#include "tools/libm_variant.hpp"
#include "tools/options.hpp"
#include "tools/radar_set.hpp"
#include "tools/scene_json.hpp"
#include "tools/settings_check.hpp"
#include "tools/units.hpp"
#include "tools/viewshed_options.hpp"

using namespace wedgescope;
using Catch::Matchers::Contains;
using Catch::Matchers::EndsWith;
using Catch::Matchers::StartsWith;
using wedgescope::test::nothing_refused;
using wedgescope::test::refusal;

namespace {

double parsed(Dimension dimension, const std::string& token) { return parse_quantity(dimension, "--key", token); }

Settings simulated(std::vector<std::string> arguments) { return parse_arguments(command_simulate, arguments); }

std::string refusal_of(std::vector<std::string> arguments) {
    return refusal([&] { simulated(arguments); });
}

/// A scene file in a folder of its own, gone with the test.
class SceneFile {
public:
    explicit SceneFile(const std::string& content) {
        static int number = 0;
        folder_ = std::filesystem::temp_directory_path() / text("options_test_", ::getpid(), "_", ++number);
        std::filesystem::create_directories(folder_);
        std::ofstream(path(), std::ios::binary) << content;
    }
    ~SceneFile() { std::filesystem::remove_all(folder_); }
    std::string path() const { return (folder_ / "scene.ini").string(); }
    std::string write(const std::string& name, const std::string& content) const {
        std::ofstream(folder_ / name, std::ios::binary) << content;
        return (folder_ / name).string();
    }
    std::string folder() const { return folder_.string(); }

private:
    std::filesystem::path folder_;
};

}  // namespace

TEST_CASE("a dimensioned value is its number in SI units", "[units]") {
    CHECK(parsed(Dimension::length, "30nmi") == 55560);
    CHECK(parsed(Dimension::length, "7000ft") == 7000 * 0.3048);
    CHECK(parsed(Dimension::length, "7kft") == Approx(2133.6).epsilon(1e-15));
    CHECK(parsed(Dimension::length, "-1.5km") == -1500);
    CHECK(parsed(Dimension::length, "1mi") == 1609.344);
    CHECK(parsed(Dimension::length, "1yd") == 0.9144);
    CHECK(parsed(Dimension::length, "1e3m") == 1000);
    CHECK(parsed(Dimension::length, "+.5m") == 0.5);
    CHECK(parsed(Dimension::length, " 30 nmi ") == 55560);
    CHECK(parsed(Dimension::time, "2.4us") == 2.4e-6);
    CHECK(parsed(Dimension::time, "0.5us") == 0.5e-6);
    CHECK(parsed(Dimension::time, "5e-1us") == 0.5e-6);
    CHECK(parsed(Dimension::time, "500ns") == 0.5e-6);
    CHECK(parsed(Dimension::time, "3ms") == 3e-3);
    CHECK(parsed(Dimension::frequency, "16.5GHz") == 16.5e9);
    CHECK(parsed(Dimension::frequency, "9375MHz") == 9.375e9);
    CHECK(parsed(Dimension::power, "50kW") == 50e3);
    CHECK(parsed(Dimension::power, "3mW") == 3e-3);
    CHECK(parsed(Dimension::power, "3MW") == 3e6);
    CHECK(parsed(Dimension::power, "30dBm") == Approx(1).epsilon(1e-15));
    CHECK(parsed(Dimension::power, "10dBW") == Approx(10).epsilon(1e-15));
    CHECK(parsed(Dimension::level, "-90dBm") == -90);
    CHECK(parsed(Dimension::level, "-120dBW") == -90);
    CHECK(parsed(Dimension::angle, "5deg") == Angle::degrees(5).rad());
    CHECK(parsed(Dimension::angle, "2mrad") == 2e-3);
    CHECK(parsed(Dimension::angle, "60arcmin") == Approx(Angle::degrees(1).rad()).epsilon(1e-15));
    CHECK(parsed(Dimension::decibel, "-3dB") == -3);
    CHECK(parsed(Dimension::bytes, "1GiB") == 0x1p30);
    CHECK(parsed(Dimension::bytes, "1GB") == 1e9);
    CHECK(parsed(Dimension::bytes, "1.5KiB") == 1536);
}

TEST_CASE("zero needs no unit, every other number does", "[units]") {
    for (const char* zero : {"0", "0.0", "-0", "+0", "0e5"}) CHECK(parsed(Dimension::length, zero) == 0);
    for (const char* zero : {"0km", "-0e-7km", "0e9223372036854775807km", "0e99999999999999999999km"})
        CHECK(parsed(Dimension::length, zero) == 0);
    const std::string message = refusal([] { parsed(Dimension::length, "30"); });
    CHECK_THAT(message, StartsWith("--key is '30'"));
    CHECK_THAT(message, Contains("m, km, ft, kft, nmi, mi, yd"));
}

TEST_CASE("what is no number with one of its units is refused by name", "[units]") {
    const char* hostile[] = {"",      " ",       "m",       "nan",      "nanm",
                             "inf",   "infm",    "-inf",    "infinity", "0x10m",
                             "1,5km", "30nm i",  "30nmi;",  "30 nmi 2", "30NMI",
                             "30Nmi", "--5m",    "+-5m",    "++5m",     "1e",
                             "1em",   "1e400m",  "-1e400m", "1e-400m",  "1e999999999999999999999m",
                             "5deg",  ".m",      "-m",      "1.2.3m",   "３０m",
                             "30mm",  "1e308km", "m30",     "30\nm\n2", "5 5m"};
    for (const char* token : hostile) {
        INFO(token);
        CHECK_THAT(refusal([&] { parsed(Dimension::length, token); }), StartsWith("--key is '"));
    }
    // A number with an embedded zero byte is not the number before it.
    CHECK_THROWS_AS(parsed(Dimension::length, std::string("30m\0x", 5)), InputError);
    // Case tells milli from mega.
    CHECK(parsed(Dimension::power, "1mW") * 1e9 == Approx(parsed(Dimension::power, "1MW")));
    CHECK_THAT(refusal([] { parsed(Dimension::decibel, "5dBm"); }), Contains("unknown unit 'dBm'"));
}

TEST_CASE("plain numbers and counts must be whole tokens", "[units]") {
    CHECK(parse_number("k", "-0.25") == -0.25);
    CHECK(parse_number("k", "1e3") == 1000);
    for (const char* token : {"", "nan", "inf", "1e999", "1x", "0x1p3", "1 2", "one"})
        CHECK_THROWS_AS(parse_number("k", token), InputError);
    CHECK(parse_count("k", "16", 16, 20) == 16);
    for (const char* token : {"15", "21", "16.0", "1e1", "16x", "", "-", "99999999999999999999"})
        CHECK_THROWS_AS(parse_count("k", token, 16, 20), InputError);
    CHECK(parse_unsigned("k", "18446744073709551615") == 18446744073709551615u);
    for (const char* token : {"18446744073709551616", "-1", "1.5", ""})
        CHECK_THROWS_AS(parse_unsigned("k", token), InputError);
    for (const char* token : {"on", "On", "true"}) CHECK(parse_switch("k", token));
    for (const char* token : {"off", "false"}) CHECK_FALSE(parse_switch("k", token));
    for (const char* token : {"", "1", "yes", "onn"}) CHECK_THROWS_AS(parse_switch("k", token), InputError);
}

TEST_CASE("a value written as text reads back as the same double", "[units]") {
    CHECK(quantity_text(Dimension::length, 55560) == "30nmi");
    CHECK(quantity_text(Dimension::length, 7000 * 0.3048) == "7000ft");
    CHECK(quantity_text(Dimension::frequency, 16.5e9) == "16.5GHz");
    CHECK(quantity_text(Dimension::time, 0.5e-6) == "0.5us");
    CHECK(quantity_text(Dimension::angle, Angle::degrees(1.5).rad()) == "1.5deg");
    CHECK(quantity_text(Dimension::angle, 0) == "0deg");
    CHECK(quantity_text(Dimension::bytes, 0x1p30) == "1GiB");
    CHECK(quantity_text(Dimension::level, -90) == "-90dBm");
    constexpr unsigned seed = 17;
    INFO("seed " << seed);
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> digits(-1, 1), exponent(-12, 12);
    for (int i = 0; i < 4000; ++i) {
        const double value = digits(random) * std::pow(10.0, exponent(random));
        for (const Dimension d : {Dimension::length, Dimension::time, Dimension::frequency, Dimension::power,
                                  Dimension::level, Dimension::angle, Dimension::decibel}) {
            const std::string written = quantity_text(d, value);
            INFO(written);
            CHECK(parse_quantity(d, "k", written) == value);
        }
    }
}

TEST_CASE("the locale plays no part", "[units]") {
    const std::string before = std::setlocale(LC_ALL, nullptr);
    // A German locale made on the spot, where its sources are installed.
    const SceneFile beside("");
    const std::string folder = beside.folder() + "/";
    std::optional<wedgescope::test::Variable> path;
    if (std::system(("localedef -i de_DE -f UTF-8 '" + folder + "de_DE.UTF-8" + "' >/dev/null 2>&1").c_str()) == 0)
        path.emplace("LOCPATH", folder);
    if (std::setlocale(LC_ALL, "de_DE.UTF-8"))
        CHECK(std::string(std::localeconv()->decimal_point) == ",");
    else
        WARN("no locale with a decimal comma can be made; tested under the C locale only");
    CHECK(parsed(Dimension::length, "1.5km") == 1500);
    CHECK_THROWS_AS(parsed(Dimension::length, "1,5km"), InputError);
    CHECK(quantity_text(Dimension::frequency, 16.5e9) == "16.5GHz");
    CHECK(simulated({"--latlon", "33.9,-117.3"}).scene.platform.latlon->lat_deg == 33.9);
    std::setlocale(LC_ALL, before.c_str());
}

TEST_CASE("every key says what it is, and its default is the program's own", "[options]") {
    std::set<std::string> names;
    std::set<char> letters;
    for (const Key& key : key_table()) {
        INFO(key.name);
        CHECK(names.insert(key.name).second);
        if (key.letter) CHECK(letters.insert(key.letter).second);
        CHECK(key.help.size() > 8);
        CHECK(key.help.find('\n') == std::string::npos);
        CHECK(key.help.back() != '.');
        CHECK(key.commands != 0);
        for (const auto& [commands, words] : key.help_elsewhere) {
            CHECK((key.commands & commands) == commands);
            CHECK(words.size() > 8);
            CHECK(words.find('\n') == std::string::npos);
            CHECK(words.back() != '.');
        }
        CHECK(key.set);
        CHECK(key.get);
        for (const CommandInfo& info : command_table()) {
            INFO(info.name);
            if (key.commands & info.command) CHECK(help_text(info).find("--" + key.name) != std::string::npos);
            for (const CommandInfo& other : command_table())
                CHECK(key.help_of(info.command).find(std::string(other.name) + ": ") == std::string::npos);
        }
        if (key.fallback.empty()) {
            CHECK_FALSE(key.get(Settings{}).has_value());
            continue;
        }
        // The text of the default reads as the default that stands in the structs.
        Settings settings;
        key.set(settings, {key.name, key.fallback, "--" + key.name, ""});
        CHECK(key.get(settings) == key.get(Settings{}));
        CHECK(key.get(Settings{}) == key.fallback);
    }
    CHECK_NOTHROW(validate(simulated({"--latlon", "0,0", "--altitude-msl", "1km"}).scene));
}

TEST_CASE("a key that commands are to share and the table lacks is a mistake that is told", "[options]") {
    std::vector<Key> keys = key_table();
    CHECK(refusal([&] { add_commands(keys); }) == nothing_refused);
    std::erase_if(keys, [](const Key& key) { return key.name == "walls"; });
    CHECK(refusal([&] { add_commands(keys); }) == "no key is called walls");
}

TEST_CASE("every key of the design exists, and those to come do not yet", "[options]") {
    for (const char* name : {"dem",
                             "culture",
                             "culture-height",
                             "culture-height-scale",
                             "culture-legend",
                             "material",
                             "latlon",
                             "xy",
                             "altitude-msl",
                             "altitude-agl",
                             "altitude-hae",
                             "geoid-offset",
                             "heading",
                             "sector",
                             "range",
                             "range-start",
                             "geometry",
                             "earth",
                             "azimuth-bins",
                             "range-bin",
                             "frequency",
                             "transmit-power",
                             "gain",
                             "losses",
                             "pulse",
                             "beam",
                             "azimuth-pattern",
                             "noise-figure",
                             "bandwidth",
                             "antenna",
                             "antenna-knee",
                             "antenna-width",
                             "antenna-exponent",
                             "antenna-floor",
                             "tilt",
                             "gamma",
                             "polarisation",
                             "sea-state",
                             "wind-direction",
                             "far-shore",
                             "walls",
                             "gases",
                             "rain",
                             "if-gain",
                             "video-gain",
                             "stc-range",
                             "stc-exponent",
                             "stc-max",
                             "dynamic-range",
                             "mds",
                             "display-gamma",
                             "minimum-range",
                             "set",
                             "bwe",
                             "ple",
                             "bwe-scale",
                             "ple-scale",
                             "noise",
                             "speckle",
                             "seed",
                             "display",
                             "sweep-delay",
                             "size",
                             "orientation",
                             "centre",
                             "rings",
                             "ring-spacing",
                             "azimuth-marks",
                             "pixel-fill",
                             "alpha",
                             "legend",
                             "quality",
                             "wedges",
                             "threads",
                             "memory",
                             "work-dir",
                             "resume",
                             "only-wedge",
                             "output",
                             "echo",
                             "power",
                             "power-stack",
                             "states",
                             "report",
                             "timeline",
                             "profile",
                             "power-unit",
                             "of",
                             "co",
                             "config",
                             "overwrite",
                             "verbose",
                             "reproducible",
                             "source",
                             "temp-dir",
                             "no-cull",
                             "quiet"}) {
        INFO(name);
        CHECK(find_key(name));
    }
    CHECK_FALSE(find_key("wals"));
}

TEST_CASE("values reach the scene", "[options]") {
    const Settings s = simulated({"--dem",
                                  "a.tif",
                                  "--latlon",
                                  "33.9,-117.3",
                                  "--altitude-msl",
                                  "7000ft",
                                  "--heading=-30deg",
                                  "--sector",
                                  "-45deg,45deg",
                                  "--range",
                                  "30nmi",
                                  "--tilt",
                                  "-2deg",
                                  "--if-gain",
                                  "-3dB",
                                  "--mds",
                                  "-90dBm",
                                  "--display",
                                  "tdppi",
                                  "--earth",
                                  "flat",
                                  "--antenna",
                                  "cos-csc2",
                                  "--gamma",
                                  "-15dB",
                                  "--bwe",
                                  "off",
                                  "--speckle",
                                  "4",
                                  "--seed",
                                  "18446744073709551615",
                                  "--memory",
                                  "300MB",
                                  "--threads",
                                  "2",
                                  "--wedges",
                                  "7",
                                  "--power-unit",
                                  "dBm",
                                  "-o",
                                  "x.png",
                                  "-q",
                                  "--co",
                                  "A=1",
                                  "--co",
                                  "B=2=3",
                                  "--config",
                                  "GDAL_X=y",
                                  "--overwrite",
                                  "--geometry",
                                  "grid",
                                  "--quality",
                                  "exact"});
    CHECK(s.dem == "a.tif");
    CHECK(s.scene.platform.latlon->lon_deg == -117.3);
    CHECK(s.scene.platform.altitude_m == 7000 * 0.3048);
    CHECK(s.scene.platform.heading == Angle::degrees(-30));
    CHECK(s.scene.sector->from == Angle::degrees(-45));
    CHECK(s.scene.sector->to == Angle::degrees(45));
    CHECK(s.scene.range_m == 55560);
    CHECK(s.scene.radar.antenna.tilt == Angle::degrees(-2));
    CHECK(s.scene.receiver.if_gain.db() == -3);
    CHECK(s.scene.receiver.mds_dbm == -90);
    CHECK(s.scene.display.kind == DisplayKind::tdppi);
    CHECK_FALSE(s.scene.earth_k);
    CHECK(s.scene.radar.antenna.elevation == ElevationPattern::cos_csc2);
    CHECK(s.scene.gamma->db() == -15);
    CHECK_FALSE(s.scene.radar.beam_width_error);
    CHECK(s.scene.receiver.speckle_looks == 4);
    CHECK(s.scene.receiver.seed == 18446744073709551615u);
    CHECK(s.memory_bytes == 300000000);
    CHECK(s.threads == 2);
    CHECK(s.wedges == 7);
    CHECK(s.power_unit == PowerUnit::dbm);
    CHECK(s.output == "x.png");
    CHECK(s.quiet);
    CHECK(s.overwrite);
    CHECK(s.creation == std::vector<std::string>{"A=1", "B=2=3"});
    CHECK(s.config == std::vector<std::pair<std::string, std::string>>{{"GDAL_X", "y"}});
    CHECK(s.scene.geometry == Geometry::grid);
    CHECK(s.scene.quality == Quality::exact);
    // A flag does not swallow what stands behind it.
    CHECK(parse_arguments(command_info, {"--json", "a.tif", "-q", "b.tif"}).files ==
          std::vector<std::string>{"a.tif", "b.tif"});
    CHECK_FALSE(simulated({"--overwrite=off"}).overwrite);
    CHECK_FALSE(simulated({"-q=off"}).quiet);
    CHECK(simulated({"-q=on"}).quiet);
    CHECK_THAT(refusal_of({"--overwrite=maybe"}), Contains("on or off"));
    CHECK_THAT(refusal_of({"-q=maybe"}), Contains("on or off"));
    CHECK_THAT(refusal_of({"-q", "-q=off"}), Contains("given twice"));
    CHECK_THAT(refusal_of({"--overwrite", "--overwrite=off"}), Contains("given twice"));
}

TEST_CASE("an error asked for chooses the quickest quality that promises it", "[options]") {
    const auto quality = [](const std::string& error) {
        return simulated({"--dem", "a.tif", "--latlon", "1,2", "--altitude-msl", "1km", "--max-error", error})
            .scene.quality;
    };
    CHECK(quality("0.4dB") == Quality::draft);
    CHECK(quality("0.39dB") == Quality::normal);
    CHECK(quality("0.1dB") == Quality::normal);
    CHECK(quality("0.05dB") == Quality::fine);
    CHECK(quality("0.02dB") == Quality::exact);
    CHECK(quality("none") == Quality::normal);
    CHECK_THROWS_WITH(quality("0.01dB"), Catch::Contains("max-error") && Catch::Contains("0.02dB"));
    CHECK_THROWS_WITH(simulated({"--dem", "a.tif", "--latlon", "1,2", "--altitude-msl", "1km", "--quality", "fine",
                                 "--max-error", "0.1dB"}),
                      Catch::Contains("at most one of quality and max-error"));
    const Settings raw = simulated({"--dem", "a.tif", "--latlon", "1,2", "--altitude-msl", "1km", "--spokes-per-post",
                                    "2.5", "--spokes-per-bin", "7", "--crossings", "off", "--course", "straight"});
    CHECK(sampling(raw.scene, GroundCover::bare, 300).spokes_per_post == 2.5);
    CHECK(sampling(raw.scene, GroundCover::bare, 300).above_posts == 0);  // so many everywhere
    CHECK(sampling(raw.scene, GroundCover::bare, 100).spokes_per_bin == 7);
    CHECK_FALSE(sampling(raw.scene, GroundCover::bare, 100).cross_lines);
    CHECK_FALSE(sampling(raw.scene, GroundCover::bare, 100).exact_course);
}

TEST_CASE("a sector runs clockwise, through the back too, and the full circle is none", "[options]") {
    const Settings back = simulated({"--sector", "170deg,-170deg"});
    CHECK(back.scene.sector->to.deg() - back.scene.sector->from.deg() == Approx(20));
    for (const char* twice : {"350deg,-350deg", "300deg,-300deg"}) {  // round north, each angle as help allows it
        const auto sector = simulated({"--sector", twice}).scene.sector;
        REQUIRE(sector);
        CHECK(sector->to.deg() - sector->from.deg() == Approx(twice[1] == '5' ? 20 : 120));
    }
    CHECK_FALSE(simulated({"--sector", "-180deg,180deg"}).scene.sector);
    CHECK_FALSE(simulated({"--sector", "0,360deg"}).scene.sector);
    for (const char* bad :
         {"10deg,10deg", "0,0", "-200deg,200deg", "0deg", "0deg,1deg,2deg", "a,b", "-45,45", "0deg,400deg", ""}) {
        INFO(bad);
        CHECK_THAT(refusal_of({"--sector", bad}), Contains("sector"));
    }
}

TEST_CASE("the command line refuses what it cannot mean", "[options]") {
    CHECK_THAT(refusal_of({"--azimuth-bin", "5"}), Contains("did you mean --azimuth-bins?"));
    CHECK_THAT(refusal_of({"--freq", "5GHz"}),
               Contains("unknown option '--freq'") && Contains("did you mean --frequency?"));
    CHECK_THAT(refusal_of({"--snow", "1"}), Contains("unknown option '--snow'"));
    CHECK_THAT(refusal_of({"-x"}), Contains("unknown option '-x'"));
    CHECK_THAT(refusal_of({"--argument", "s.ini"}), Contains("unknown option '--argument'"));
    CHECK_THAT(refusal_of({"--argument=s.ini"}), Contains("unknown option '--argument'"));
    CHECK_THAT(refusal_of({"--=s.ini"}), Contains("unknown option '--'"));
    CHECK_THAT(refusal_of({"-overwrite"}), Contains("--overwrite"));
    CHECK_THAT(refusal_of({"-quiet"}), StartsWith("option '-quiet' has one dash; did you mean --quiet?"));
    CHECK(refusal_of({"-qh"}) ==
          "option '-qh' cannot be understood; accepted: -q, -q=on or -q=off, and each option a word of its own");
    CHECK(refusal_of({"-range", "5km"}) == "option '-range' has one dash; did you mean --range?");
    CHECK(refusal([] {
              parse_arguments(command_coverage, {"-layer=height", "a.tif", "b.tif"});
          }) == "option '-layer' has one dash; did you mean --layer?");
    for (const char* option : {"--dem", "--output=b.tif", "-o", "-ob.tif"}) {
        CHECK_THAT(refusal([&] {
                       parse_arguments(command_coverage, {"a.tif", option, "b.tif"});
                   }),
                   Contains("files are named without an option: wedgescope coverage [options] IN OUT"));
        CHECK_THAT(refusal([&] {
                       parse_arguments(command_tile, {"a.tif", option, "b"});
                   }),
                   Contains("files are named without an option: wedgescope tile [options] RASTER... FOLDER"));
    }
    CHECK_THAT(refusal([] {
                   parse_arguments(command_info, {"--dem", "a.tif"});
               }),
               Contains("files are named without an option: wedgescope info [options] FILE..."));
    CHECK(refusal_of({"--sector", "0deg", "-60deg"}) ==
          "'-60deg' is no option; two numbers are one word, as in --latlon 40.5,-117.8 or --sector -45deg,45deg");
    CHECK(refusal_of({"--latlon", "40.5", "-117.8"}) ==
          "'-117.8' is no option; two numbers are one word, as in --latlon 40.5,-117.8 or --sector -45deg,45deg");
    CHECK(refusal_of({"--sector", "-60deg", "60deg"}) ==
          "'60deg' is no file; two numbers are one word, as in --latlon 40.5,-117.8 or --sector -45deg,45deg");
    for (const char* file : {"3d.ini", "3764078.07.ini", "-5.ini", "45deg,90deg"})
        CHECK_THAT(refusal_of({"--", file}), Contains("scene file '" + std::string(file) + "' cannot be opened"));
    CHECK_THAT(refusal_of({"--range"}), Contains("--range needs a value"));
    CHECK_THAT(refusal_of({"--range="}), Contains("--range needs a value"));
    CHECK_THAT(refusal_of({"--range", "--overwrite"}), Contains("--range needs a value"));
    CHECK_THAT(refusal_of({"--range", "0"}), Contains("--range is '0'; it must be above 0m"));
    CHECK_THAT(refusal_of({"--range", "-5km"}), Contains("above 0m"));
    CHECK_THAT(refusal_of({"--range", "30"}), Contains("bare number"));
    CHECK_THAT(refusal_of({"--range", "1km", "--range", "2km"}), Contains("given twice"));
    // A word that is none of those accepted is told them, a number only what numbers are.
    CHECK(refusal_of({"--range", "atuo"}) ==
          "--range is 'atuo'; a length with its unit is needed (m, km, ft, kft, nmi, mi, yd), or auto");
    CHECK(refusal_of({"--rain", "hevy"}) ==
          "--rain is 'hevy'; a rain rate with its unit is needed (mm/h, in/h), or "
          "clear, drizzle, light, moderate, heavy, excessive");
    CHECK_THAT(refusal_of({"--gases", "hi"}), EndsWith("(g/m3, g/m^3, kg/m3), or normal, high, none"));
    CHECK_THAT(refusal_of({"--threads", "many"}), EndsWith("a whole number from 1 to 4096 is needed, or all"));
    CHECK_THAT(refusal_of({"--spokes-per-bin", "few"}), EndsWith("a plain number is needed, or auto"));
    CHECK_THAT(refusal_of({"--range", "5"}), EndsWith("(m, km, ft, kft, nmi, mi, yd)"));
    CHECK_THAT(refusal_of({"--threads", "0"}), EndsWith("a whole number from 1 to 4096 is needed"));
    CHECK_THAT(refusal_of({"--frequency", "auto"}), EndsWith("(Hz, kHz, MHz, GHz)"));
    CHECK_THAT(refusal_of({"--display", "radar"}), Contains("gpi, gpi-true, ppi, tdppi"));
    CHECK_THAT(refusal_of({"--latlon", "91,0"}), Contains("latitude from -90 to 90"));
    CHECK_THAT(refusal_of({"--latlon", "33.9"}), Contains("LAT,LON"));
    CHECK_THAT(refusal_of({"--latlon", "nan,0"}), Contains("LAT,LON"));
    CHECK_THAT(refusal_of({"--latlon", "33,9,-117,3"}), Contains("LAT,LON"));
    CHECK_THAT(refusal_of({"--latlon", "0,0", "--xy", "1,2"}), Contains("exactly one of latlon and xy"));
    for (const std::string half : {"453717,", ",4484800", " , ", "453717"})
        CHECK(refusal_of({"--xy", half}) ==
              "--xy is '" + half + "'; it must be X,Y in the terrain raster's own coordinates");
    CHECK_THAT(refusal_of({"--altitude-msl", "1km", "--altitude-agl", "1km"}),
               Contains("altitude-msl, altitude-agl and altitude-hae"));
    CHECK_THAT(refusal_of({"--dem", ""}), Contains("--dem is empty"));
    CHECK_THAT(refusal_of({"--material", "cheese"}), Contains("cheese") && Contains("soil"));
    CHECK_THAT(refusal_of({"--co", "COMPRESS"}), Contains("NAME=VALUE"));
    CHECK_THAT(refusal_of({"--bwe"}), Contains("needs a value"));
    CHECK_THAT(refusal_of({"--size", "1024.5"}), Contains("whole number"));
    CHECK_THAT(refusal_of({"--json"}), Contains("unknown option '--json'"));
    CHECK_THAT(refusal_of({"a.ini", "b.ini"}), Contains("two scene files") || Contains("cannot be opened"));
    CHECK_THAT(refusal([] { command_by_name("simulat"); }), Contains("did you mean simulate?"));
    CHECK_THAT(refusal([] { command_by_name("vieww"); }), Contains("unknown command 'vieww'"));
}

TEST_CASE("gdal_viewshed's options are refused under their own names", "[options]") {
    const auto parsed_as = [](std::vector<std::string> words) {
        words.insert(words.end(), {"in.tif", "out.tif"});
        const ViewshedArguments translated = translate_viewshed(words);
        return parse_arguments(command_coverage, translated.words, translated.given, translated.defaults);
    };
    const auto refused = [&](std::vector<std::string> words) {
        words.insert(words.begin(), {"-ox", "1", "-oy", "2"});
        return refusal([&] { parsed_as(words); });
    };
    CHECK(refused({"-oz", "-50"}) == "-oz is '-50'; it must be from 0m to 1000km");
    CHECK(refused({"-tz", "-1"}) == "-tz is '-1'; it must be from 0m to 100km");
    CHECK(refused({"-md", "-5"}) == "-md is '-5'; it must be above 0m up to 10000km");
    CHECK(refused({"-cc", "-0.1"}) == "-cc is '-0.1'; it must be 0 (flat) or from 0.00001 to 10");
    for (const char* value : {"-vv", "-iv", "-ov", "-a_nodata"})
        CHECK(refused({value, "-9"}) == text(value, " is '-9'; a whole number from 0 to 255 is needed"));
    CHECK_THAT(refused({"--xy", "1,2"}), StartsWith("--xy is given beside -ox and -oy; both say xy"));
    CHECK_THAT(refused({"--latlon", "1,2"}), StartsWith("--latlon is given beside -ox and -oy; exactly one of"));
    CHECK_THAT(refused({"--observers", "f.csv"}), StartsWith("--observers is given beside -ox and -oy; the file"));
    CHECK_THAT(refused({"-oz", "5", "--altitude-msl", "5m"}), StartsWith("--altitude-msl is given beside -oz;"));
    CHECK_THAT(refused({"-oz", "5", "--altitude-agl=5m"}), StartsWith("--altitude-agl is given beside -oz;"));
    CHECK_THAT(refused({"-vv", "5", "-vv", "6"}), StartsWith("option -vv is given twice"));
    CHECK_THAT(refused({"-oz", "5m"}), StartsWith("-oz is '5m'; a plain number"));
    // Its defaults give way to what is given under any name.
    const Settings plain = parsed_as({"-ox", "1", "-oy", "2"});
    CHECK(plain.scene.platform.altitude_m == 2);
    CHECK(plain.coverage.mask.outside == 0);
    CHECK(plain.scene.geometry == Geometry::grid);
    const Settings own = parsed_as({"-ox", "1", "-oy", "2", "-md", "0", "--altitude-msl=9m", "--earth", "flat",
                                    "--outside-value", "7", "--geometry", "geodesic"});
    CHECK(own.scene.platform.altitude_m == 9);
    CHECK(own.scene.platform.altitude_above == AltitudeAbove::sea_level);
    CHECK_FALSE(own.scene.earth_k);
    CHECK(own.coverage.mask.outside == 7);
    CHECK(own.scene.geometry == Geometry::geodesic);
    CHECK_FALSE(own.scene.ground_range_m);
    CHECK(parsed_as({"-f", "HFA"}).driver == "HFA");
    CHECK(parsed_as({"-of", "HFA"}).driver == "HFA");
    CHECK_THAT(refused({"-f", "HFA", "-of", "HFA"}), StartsWith("-of is given beside -f;"));
    // Behind -- stand paths.
    CHECK(parsed_as({"--", "-oz"}).files == std::vector<std::string>{"-oz", "in.tif", "out.tif"});
}

TEST_CASE("the sweep's delay is the sensor's height, a length, or a time there and back", "[options]") {
    const auto delay = [](const char* value) {
        return simulated({"--sweep-delay", value}).scene.display.sweep_delay_m;
    };
    CHECK_FALSE(delay("altitude"));
    CHECK_FALSE(delay("auto"));
    CHECK(find_key("sweep-delay")->get(simulated({})) == "altitude");
    CHECK(delay("3km") == 3000);
    CHECK(delay("0") == 0);
    CHECK_THAT(*delay("20us"), Catch::Matchers::WithinRel(2997.92458, 1e-15));
    CHECK_THAT(*delay("0.02 ms"), Catch::Matchers::WithinRel(2997.92458, 1e-15));
    for (const char* bad : {"-1m", "-1us", "10001km", "0.1s"})
        CHECK_THAT(refusal([&] { delay(bad); }), Contains("sweep-delay is '") && Contains("from 0m to 10000km"));
    for (const char* bad : {"3", "3deg", "height", "", "3kmus"})
        CHECK_THAT(refusal([&] { delay(bad); }),
                   Contains("sweep-delay") && Contains("altitude") && Contains("nmi") && Contains("us"));
}

TEST_CASE("the tube's centre is two fractions of the half side, or fits", "[options]") {
    const auto centre = [](const char* value) { return simulated({"--centre", value}).scene.display.centre; };
    CHECK_FALSE(centre("auto"));
    CHECK(centre("0,-0.9")->y == -0.9);
    CHECK(centre("1, -1")->x == 1);
    for (const char* bad : {"0", "0,1.01", "-1.5,0", "0,0,0", "a,b", "0,", "nan,0"})
        CHECK_THAT(refusal([&] { centre(bad); }), Contains("centre is '"));
    CHECK_THAT(refusal([] { simulated({"--pixel-fill", "all"}); }), Contains("interpolate, holes, none"));
    CHECK_THAT(refusal([] { simulated({"--azimuth-marks", "30"}); }), Contains("deg"));
    CHECK_THAT(refusal([] { simulated({"--bwe-scale", "21"}); }), Contains("from 0.1 to 20"));
}

TEST_CASE("a complete scene has a terrain, one place, one altitude and a legend for its culture", "[options]") {
    const auto incomplete = [](std::vector<std::string> arguments) {
        return refusal([&] { check_complete(simulated(arguments)); });
    };
    CHECK_NOTHROW(check_complete(simulated({"--dem", "a", "--xy", "0,0", "--altitude-agl", "1km"})));
    CHECK_THAT(incomplete({"--xy", "0,0", "--altitude-agl", "1km"}), Contains("dem"));
    CHECK_THAT(incomplete({"--dem", "a", "--altitude-agl", "1km"}), Contains("latlon and xy"));
    CHECK_THAT(incomplete({"--dem", "a", "--xy", "0,0"}), Contains("altitude-msl, altitude-agl and altitude-hae"));
    CHECK_THAT(incomplete({"--dem", "a", "--xy", "0,0", "--altitude-hae", "1km"}), Contains("geoid-offset"));
    CHECK_THAT(incomplete({"--dem", "a", "--xy", "0,0", "--altitude-agl", "1km", "--culture", "c"}),
               Contains("culture-legend"));
    CHECK_THAT(incomplete({"--dem", "a", "--xy", "0,0", "--altitude-agl", "1km", "--culture-legend", "nlcd"}),
               Contains("no culture"));
    CHECK_THAT(
        incomplete({"--dem", "a", "--xy", "0,0", "--altitude-agl", "1km", "--range", "1km", "--range-start", "2km"}),
        Contains("range-start"));
}

TEST_CASE("a scene file holds the same keys; the command line wins; paths start from the file", "[options]") {
    const SceneFile file(
        "\xef\xbb\xbf# a scene\r\n"
        "dem = terrain/dem.tif   # the terrain\r\n"
        "culture= /data/c#1.tif\n"
        "culture-height = /vsizip/x.zip/h.tif\n"
        "culture-legend = nlcd\n"
        "\n"
        "latlon = 33.9,-117.3\n"
        "altitude-msl = 7000 ft\n"
        "range=30nmi\n"
        "rings = false\n"
        "output = out.png\n"
        "co = A=1\n"
        "co = B=2\n"
        "overwrite = on");
    const Settings s = simulated({file.path()});
    CHECK(s.dem == file.folder() + "/terrain/dem.tif");
    CHECK(s.culture == "/data/c#1.tif");
    CHECK(s.culture_height == "/vsizip/x.zip/h.tif");
    CHECK(s.culture_legend == "nlcd");
    CHECK(s.output == file.folder() + "/out.png");
    CHECK(s.scene.range_m == 55560);
    CHECK_FALSE(s.scene.display.rings);
    CHECK(s.overwrite);
    CHECK(s.creation.size() == 2);

    const Settings over = simulated({"--range", "10nmi", file.path(), "--altitude-agl", "500m", "--xy", "1,2", "-o",
                                     "mine.png", "--overwrite=off", "--co", "C=3"});
    CHECK(over.scene.range_m == 18520);
    CHECK(over.scene.platform.altitude_above == AltitudeAbove::ground);
    CHECK(over.scene.platform.altitude_m == 500);
    CHECK(over.scene.platform.xy->y == 2);
    CHECK_FALSE(over.scene.platform.latlon);
    CHECK(over.output == "mine.png");
    CHECK_FALSE(over.overwrite);
    CHECK(over.creation == std::vector<std::string>{"C=3"});
    CHECK(over.dem == s.dem);
}

TEST_CASE("a path that is no plain file stays as it is", "[options]") {
    for (const char* path :
         {"/a/b.tif", "/vsicurl/https://x/y.tif", "NETCDF:\"a.nc\":v", "https://x/y.tif", "HDF5:a.h5://b"}) {
        const Settings s = settings_from(read_scene("/folder/scene.ini", text("dem = ", path)), {});
        CHECK(s.dem == path);
    }
    CHECK(settings_from(read_scene("/folder/scene.ini", "dem = ../a.tif"), {}).dem == "/a.tif");
    CHECK(settings_from(read_scene("scene.ini", "dem = a.tif"), {}).dem == "a.tif");
}

TEST_CASE("the file in a driver's own name for a part of it starts from the scene file's folder, if it lies there",
          "[options]") {
    const SceneFile folder("");
    const std::string here = folder.folder() + "/";
    for (const char* name : {"a.nc", "a b.nc", "a:b.tif", "z.zip"}) folder.write(name, "something");
    std::filesystem::create_directory(here + "sub");
    folder.write("sub/c.nc", "something");
    const auto dem = [&](const std::string& path) {
        return settings_from(read_scene(here + "scene.ini", "dem = " + path + "\n"), {}).dem;
    };
    CHECK(dem("NETCDF:a.nc:v") == "NETCDF:" + here + "a.nc:v");
    CHECK(dem("NETCDF:\"a b.nc\":v") == "NETCDF:\"" + here + "a b.nc\":v");
    CHECK(dem("NETCDF:sub/c.nc:v") == "NETCDF:" + here + "sub/c.nc:v");
    CHECK(dem("GTIFF_DIR:2:a:b.tif") == "GTIFF_DIR:2:" + here + "a:b.tif");
    CHECK(dem("/vsizip/z.zip") == "/vsizip/" + here + "z.zip");
    CHECK(dem("/vsizip/z.zip/in/y.tif") == "/vsizip/" + here + "z.zip/in/y.tif");
    // Not there, or not from there.
    for (const std::string& path :
         {std::string("NETCDF:b.nc:v"), std::string("/vsizip/other.zip/y.tif"), "NETCDF:" + here + "a.nc:v",
          "/vsizip/" + here + "z.zip/y.tif", std::string("/vsicurl/https://a.nc")})
        CHECK(dem(path) == path);
}

TEST_CASE("words are taken in any case of letters, units as they are", "[options]") {
    const Settings s =
        simulated({"--polarisation", "VV", "--display", "PPI", "--rain", "Heavy", "--sector", "FULL", "--noise", "On",
                   "--earth", "Flat", "--range", "AUTO", "--gases", "None", "--centre", "Auto"});
    CHECK(s.scene.radar.polarisation == Polarisation::vv);
    CHECK(s.scene.display.kind == DisplayKind::ppi);
    CHECK(s.scene.receiver.noise);
    CHECK(!s.scene.earth_k);
    CHECK(*find_key("rain")->get(s) == "heavy");
    CHECK(*find_key("polarisation")->get(s) == "vv");
    CHECK_THAT(refusal_of({"--transmit-power", "1mw"}), Contains("unknown unit 'mw'"));
}

TEST_CASE("a value in double quotes may hold what begins a comment", "[options]") {
    const auto dem = [](const std::string& value) {
        return settings_from(read_scene("/f/scene.ini", "range = 30nmi # far\ndem = " + value + "\n"), {}).dem;
    };
    CHECK(dem("a#b.tif # terrain") == "/f/a#b.tif");
    CHECK(dem("\"cell #1.tif\"") == "/f/cell #1.tif");
    CHECK(dem("\"cell #1.tif\"\t# the first = one") == "/f/cell #1.tif");
    CHECK(dem("NETCDF:\"a.nc\":v") == "NETCDF:\"a.nc\":v");
    const auto wrong = [&](const std::string& value) { return refusal([&] { dem(value); }); };
    CHECK_THAT(wrong("\"cell #1.tif"), Contains("line 2: dem begins with a double quote that nothing closes"));
    CHECK_THAT(wrong("\"cell 1.tif\" x"), Contains("line 2: dem goes on behind the double quote that closes it"));
    CHECK_THAT(wrong("\"\""), Contains("line 2: dem has no value"));
}

TEST_CASE("a scene file is refused with the line that is wrong", "[options]") {
    const auto wrong = [](const std::string& content) {
        return refusal([&] { settings_from(read_scene("s.ini", content), {}); });
    };
    CHECK_THAT(wrong("\n\nrange 30nmi\n"), Contains("line 3") && Contains("key = value"));
    CHECK_THAT(wrong("ranges = 30nmi"),
               Contains("line 1") && Contains("unknown key 'ranges'") && Contains("did you mean range?"));
    CHECK_THAT(wrong("range = 30nmi\nrange = 20nmi"), Contains("line 2") && Contains("line 1"));
    CHECK_THAT(wrong("range ="), Contains("no value"));
    CHECK_THAT(wrong("range = 30"), Contains("line 1") && Contains("nmi"));
    CHECK_THAT(wrong("= 30"), Contains("unknown key"));
    CHECK_THAT(wrong("[scene]"), Contains("key = value"));
    CHECK_THAT(wrong("json = on"), Contains("unknown key"));
    CHECK_THAT(wrong("snow = 4"), Contains("unknown key"));
    CHECK_THAT(wrong("bwe = yes"), Contains("on or off"));
    CHECK_THAT(wrong("latlon = 1,2\nxy = 1,2"), Contains("exactly one of latlon and xy"));
    CHECK_THAT(wrong("altitude-msl = 1km\naltitude-hae = 1km"), Contains("exactly one of altitude-msl"));
    CHECK_THAT(wrong(std::string("dem = a\0b", 9)), Contains("zero byte"));
    CHECK_THAT(wrong(std::string("II*\0\x80\x01\x02 binary", 14)), Contains("key = value"));
    CHECK_THROWS_AS(simulated({"/nowhere/scene.ini"}), IoError);
    CHECK_THROWS_AS(simulated({"/"}), IoError);
}

TEST_CASE("all parameters survive the way through JSON to the bit", "[options]") {
    const Settings s = simulated({"--dem",
                                  "a.tif",
                                  "--latlon",
                                  "33.923456789012345,-117.3",
                                  "--altitude-msl",
                                  "7001ft",
                                  "--heading",
                                  "12.34567deg",
                                  "--sector",
                                  "-45.1deg,33.3deg",
                                  "--range",
                                  "31.7nmi",
                                  "--tilt",
                                  "0.1234rad",
                                  "--pulse",
                                  "2.4us",
                                  "--beam",
                                  "1.7deg",
                                  "--earth",
                                  "1.21",
                                  "--mds",
                                  "-91.7dBm",
                                  "--transmit-power",
                                  "77dBm",
                                  "--gamma",
                                  "-13.7dB",
                                  "--stc-range",
                                  "5.3nmi",
                                  "--seed",
                                  "18446744073709551615",
                                  "--memory",
                                  "777MB",
                                  "--co",
                                  "A=1",
                                  "--echo",
                                  "e.tif",
                                  "--azimuth-bins",
                                  "961",
                                  "--antenna",
                                  "gaussian",
                                  "--geoid-offset",
                                  "-32.1m",
                                  "--sweep-delay",
                                  "1.23456789km",
                                  "--centre",
                                  "0.3,-0.9",
                                  "--ring-spacing",
                                  "2.7nmi",
                                  "--azimuth-marks",
                                  "22.5deg",
                                  "--bwe-scale",
                                  "2.3",
                                  "--pixel-fill",
                                  "holes",
                                  "--culture-height-scale",
                                  "0.1"});
    const auto json = parameters_json(s, true);
    const Settings back = settings_from({}, given_in_json(nlohmann::ordered_json::parse(json.dump())));
    CHECK(parameters_json(back, true) == json);
    CHECK(back.scene.platform.latlon->lat_deg == s.scene.platform.latlon->lat_deg);
    CHECK(back.scene.platform.altitude_m == s.scene.platform.altitude_m);
    CHECK(back.scene.platform.heading == s.scene.platform.heading);
    CHECK(back.scene.sector->from == s.scene.sector->from);
    CHECK(back.scene.sector->to == s.scene.sector->to);
    CHECK(back.scene.range_m == s.scene.range_m);
    CHECK(back.scene.radar.antenna.tilt == s.scene.radar.antenna.tilt);
    CHECK(back.scene.radar.transmit_power_w == s.scene.radar.transmit_power_w);
    CHECK(back.scene.receiver.seed == s.scene.receiver.seed);
    CHECK(back.scene.display.centre->x == 0.3);
    CHECK(back.scene.display.centre->y == -0.9);
    CHECK(back.scene.display.ring_spacing_m == s.scene.display.ring_spacing_m);
    CHECK(back.scene.display.azimuth_marks_rad == s.scene.display.azimuth_marks_rad);
    CHECK(back.scene.radar.beam_width_scale == 2.3);
    CHECK(back.scene.display.pixel_fill == PixelFill::holes);
    CHECK(back.scene.earth_k == s.scene.earth_k);
    CHECK(back.memory_bytes == s.memory_bytes);
    // No path, split or budget stands in the JSON that goes into the rasters.
    const auto scene = parameters_json(s, false);
    for (const char* name : {"dem", "echo", "memory", "threads", "wedges", "co", "overwrite"})
        CHECK_FALSE(scene.contains(name));
    for (const char* name : {"latlon", "range", "frequency", "if-gain", "display", "bwe", "quality"})
        CHECK(scene.contains(name));
}

TEST_CASE("a radar set lies below the scene file, and that below the command line", "[options]") {
    const SceneFile file("set = f111a\ndem = a.tif\nlatlon = 33.9,-117.3\naltitude-msl = 7000ft\npulse = 0.4us\n");
    const Settings s = simulated({file.path(), "--gain", "30dB"});
    CHECK(s.radar_set == "f111a");
    CHECK(s.scene.radar.frequency_hz == 16.5e9);
    CHECK(s.scene.radar.antenna.knee == Angle::degrees(3));  // the set's; 5deg without it
    CHECK(s.scene.radar.pulse_s == 0.4e-6);                  // the file's
    CHECK(s.scene.radar.gain.db() == 30);                    // the command line's
    CHECK_FALSE(s.scene.receiver.minimum_range_m);           // auto
    // Of two sets the command line's counts, and all of it.
    const Settings other = simulated({file.path(), "--set", "x-navigation"});
    CHECK(other.radar_set == "x-navigation");
    CHECK(other.scene.radar.frequency_hz == 9.375e9);
    CHECK(other.scene.radar.antenna.beam == Angle::degrees(3));
    CHECK(other.scene.radar.pulse_s == 0.4e-6);
    // A file beside the scene file.
    file.write("mine.ini", "# mine\nfrequency = 35GHz\nspeckle = 2\nantenna = dish.csv\n");
    file.write("dish.csv", "-10,-30\n0,0\n30,-20\n");
    file.write("scene.ini", "set = mine.ini\n");
    const Settings mine = simulated({file.path(), "--speckle", "1"});
    CHECK(mine.radar_set == file.folder() + "/mine.ini");
    CHECK(mine.scene.radar.frequency_hz == 35e9);
    CHECK(mine.scene.receiver.speckle_looks == 1);
    CHECK(mine.scene.radar.antenna.elevation == ElevationPattern::points);
    CHECK(mine.antenna_file == file.folder() + "/dish.csv");
    // The values are what counts: as given one by one, and of what goes into the rasters no name is a part.
    std::vector<std::string> one_by_one;
    for (const Given& given : read_scene("f111a.ini", shipped_set("f111a")->content)) {
        one_by_one.push_back("--" + given.key);
        one_by_one.push_back(given.value);
    }
    CHECK(parameters_json(simulated({"--set", "f111a"}), false) == parameters_json(simulated(one_by_one), false));
    CHECK_FALSE(parameters_json(simulated({"--set", "f111a"}), false).contains("set"));
    CHECK(parameters_json(simulated({"--set", "f111a"}), true)["set"] == "f111a");
}

TEST_CASE("each shipped set is a whole radar, valid, and says what it is", "[options]") {
    REQUIRE(shipped_sets().size() >= 3);
    std::set<std::string> keys;
    for (const RadarSet& set : shipped_sets()) {
        INFO(set.name);
        CHECK(set.summary().size() > 20);
        CHECK_THAT(set.content, Contains("[P]") && Contains("GHz"));
        CHECK_THAT(shipped_set_names(), Contains(set.name));
        CHECK_THAT(find_key("set")->accepted, Contains(set.name));
        CHECK_NOTHROW(validate(simulated({"--set", set.name, "--latlon", "0,0", "--altitude-msl", "1km"}).scene));
        std::set<std::string> own;
        for (const Given& given : read_scene(set.name, set.content)) own.insert(given.key);
        for (const char* key : {"frequency", "transmit-power", "gain", "losses", "pulse", "noise-figure", "beam",
                                "antenna", "antenna-knee", "antenna-width", "if-gain", "dynamic-range"})
            CHECK(own.contains(key));
    }
    CHECK_FALSE(shipped_set("F111A"));
}

TEST_CASE("what is no radar set is refused by name, with the line and what is accepted", "[options]") {
    const SceneFile file("set = none.ini");
    CHECK_THAT(refusal_of({"--set", "f11a"}), StartsWith("--set is 'f11a', and there is no such file") &&
                                                  Contains("one of f111a, ku-mapping, x-navigation or a file") &&
                                                  Contains("did you mean f111a?"));
    CHECK_THAT(refusal_of({file.path()}), Contains("line 1: set is '" + file.folder() + "/none.ini'"));
    const auto wrong = [&](const std::string& content) {
        return refusal_of({"--set", file.write("mine.ini", content)});
    };
    CHECK_THAT(wrong("gain = 30dB\nlatlon = 1,2\n"),
               Contains("mine.ini', line 2: latlon is no key of a radar set") && Contains("Radar, Antenna, Receiver"));
    for (const char* line : {"dem = a.tif", "display = ppi", "set = f111a", "azimuth-bins = 960", "output = x.png"})
        CHECK_THAT(wrong(line), Contains("line 1: ") && Contains("is no key of a radar set"));
    CHECK_THAT(wrong("frequncy = 9GHz"), Contains("unknown key 'frequncy'; did you mean frequency?"));
    CHECK_THAT(wrong("frequency = 9"), Contains("mine.ini', line 1: frequency is '9'") && Contains("GHz"));
    CHECK_THAT(wrong("gain = 30dB\ngain = 31dB"), Contains("line 2: gain stands in line 1 already"));
    CHECK_THAT(wrong("gain 30dB"), Contains("key = value"));
    CHECK_THAT(wrong("gain ="), Contains("no value"));
    CHECK_THROWS_AS(simulated({"--set", file.folder()}), IoError);
    // What the scene file gives in its place is not looked at: but a wrong line is a wrong line.
    CHECK_NOTHROW(simulated({"--set", file.write("mine.ini", "frequency = 9"), "--frequency", "9GHz"}));
}

TEST_CASE("what is a secret of --config stays out of what is handed on", "[options]") {
    const Settings s = simulated({"--config", "AWS_SECRET_ACCESS_KEY=hunter2", "--config",
                                  "GDAL_HTTP_USERPWD=me:hunter2", "--config", "GTIFF_POINT_GEO_IGNORE=YES"});
    CHECK(s.config.front().second == "hunter2");
    const std::string all = parameters_json(s, true).dump();
    CHECK_THAT(all, !Contains("hunter2") && Contains("AWS_SECRET_ACCESS_KEY=(not shown)") &&
                        Contains("GTIFF_POINT_GEO_IGNORE=YES"));
}

TEST_CASE("an antenna's file is read into points that need no file any more", "[options]") {
    const SceneFile file("antenna = dish.csv\n");
    file.write("dish.csv",
               "\xef\xbb\xbf# measured\r\n\r\nDepression_deg,gain_dB\r\n-12.3,-31.07\r\n 0 , 0 "
               "\r\n0.1rad,-1e1dB\r\n33.333,-12\n");
    const Settings s = simulated({file.path()});
    const AntennaParams& antenna = s.scene.radar.antenna;
    REQUIRE(antenna.points.size() == 4);
    CHECK(antenna.points[0] == PatternPoint{Angle::degrees(-12.3), Decibel(-31.07)});
    CHECK(antenna.points[2] == PatternPoint{Angle::radians(0.1), Decibel(-10)});
    CHECK(s.antenna_file == file.folder() + "/dish.csv");
    const auto json = parameters_json(s, false);
    CHECK(json["antenna"] ==
          "points:-12.3,-31.07;0,0;" +
              quantity_text(Dimension::angle, 0.1).substr(0, quantity_text(Dimension::angle, 0.1).find("deg")) +
              ",-10;33.333,-12");
    std::filesystem::remove(file.folder() + "/dish.csv");
    const Settings back = settings_from({}, given_in_json(nlohmann::ordered_json::parse(json.dump())));
    CHECK(back.scene.radar.antenna.points == antenna.points);
    CHECK(back.antenna_file.empty());
    // A law on the command line takes its place, whole.
    file.write("dish.csv", "0,0\n1,-1\n");
    const Settings law = simulated({file.path(), "--antenna", "cos-csc2"});
    CHECK(law.scene.radar.antenna.points.empty());
    CHECK(law.antenna_file.empty());
    constexpr unsigned seed = 5;
    INFO("seed " << seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> step(0.13, 0.9), gain(-60, 0);
    std::string content;
    double beta = -89.123;
    for (int i = 0; i < 200; ++i, beta += step(random)) content += fmt::format("{},{}\n", beta, gain(random));
    const Settings many = simulated({"--antenna", file.write("many.csv", content)});
    REQUIRE(many.scene.radar.antenna.points.size() == 200);
    CHECK(settings_from({}, given_in_json(parameters_json(many, false))).scene.radar.antenna.points ==
          many.scene.radar.antenna.points);
}

TEST_CASE("a wrong antenna file is refused with its line and what is accepted", "[options]") {
    const SceneFile file("");
    const auto wrong = [&](const std::string& content) {
        return refusal_of({"--antenna", file.write("dish.csv", content)});
    };
    CHECK_THAT(wrong("0,0\n5,-1\n5,-2\n"), Contains("antenna file '") &&
                                               Contains("dish.csv', line 3: the depression is 5 deg after 5 deg") &&
                                               Contains("ascending"));
    CHECK_THAT(wrong("0,0\n\n# x\n5,1\n"), Contains("line 4: the gain is 1 dB") && Contains("from -200 to 0 dB"));
    CHECK_THAT(wrong("0,0\n0.1,-49.9\n0.2,-100.1\n"),
               Contains("line 3: the gain changes by 50.2 dB in 0.1 deg; accepted: at most 500 dB a degree"));
    CHECK_THAT(wrong("0,-200\n0.001,0\n"), Contains("line 2: the gain changes by 200 dB in 0.001 deg"));
    CHECK_THAT(wrong("0,0\n95,-1\n"), Contains("line 2: the depression is 95 deg") && Contains("from -90 to 90 deg"));
    CHECK_THAT(wrong("0,0\n"), Contains("there is 1 point; accepted: from 2 to 4096"));
    CHECK_THAT(wrong("# nothing\n"), Contains("there are 0 points"));
    CHECK_THAT(wrong("0,0\n5\n"), Contains("line 2: found 1 cell; accepted: two, depression_deg,gain_db"));
    CHECK_THAT(wrong("0,0,0\n"), Contains("line 1: found 3 cells"));
    CHECK_THAT(wrong("0,0\n5,-1m\n"), Contains("line 2: gain_db is '-1m'") && Contains("dB"));
    CHECK_THAT(wrong("0,0\n5,\n"), Contains("line 2: gain_db is ''"));
    CHECK_THAT(wrong("0,0\nnan,-1\n"), Contains("line 2: depression_deg is 'nan'"));
    // An elevation has the other sign: what the columns are is not guessed.
    CHECK_THAT(wrong("elevation_deg,gain_db\n0,0\n5,-1\n"),
               Contains("line 1: the columns are 'elevation_deg,gain_db'; accepted: depression_deg,gain_db"));
    std::string many;
    for (int i = 0; i < 5000; ++i) many += fmt::format("{},-1\n", 0.01 * i);
    CHECK_THAT(wrong(many), Contains("line 4097: there are more than 4096 points"));
    CHECK_THAT(refusal_of({"--antenna", "gausian"}),
               StartsWith("--antenna is 'gausian', and there is no such file") && Contains("did you mean gaussian?"));
    CHECK_THAT(refusal_of({"--antenna", "points:0,0;5"}), Contains("--antenna, point 2: found '5'"));
    CHECK_THAT(refusal_of({"--antenna", "points:0,0;-5,-1"}),
               Contains("--antenna, point 2: the depression is -5 deg after 0"));
    CHECK_THAT(refusal_of({"--antenna", "points:"}), Contains("there are 0 points"));
    CHECK_THROWS_AS(simulated({"--antenna", file.folder()}), IoError);
}

TEST_CASE("what help says a key accepts is what the engine accepts", "[options]") {
    int checked = 0;
    for (const Key& key : key_table()) {
        if (!(key.commands & command_simulate)) continue;
        std::istringstream words(key.accepted);
        std::string kind, low, to, high;
        words >> kind >> low >> to;
        if (to == "up") words >> to;
        words >> high;
        if (high.size() > 15) continue;  // the seed: any whole number
        if ((kind != "from" && kind != "above") || to != "to" || high.find_first_not_of("-.0123456789") == 0) continue;
        const auto scene = [&](const std::string& value) {
            std::vector<std::string> arguments{"--dem", "x.tif", "--xy", "1,2", "--output", "x.png"};
            if (!key.name.starts_with("altitude-")) arguments.insert(arguments.end(), {"--altitude-msl", "1000m"});
            if (key.name == "altitude-hae") arguments.insert(arguments.end(), {"--geoid-offset", "0m"});
            if (key.name == "antenna-knee") arguments.insert(arguments.end(), {"--antenna", "gaussian"});
            arguments.push_back("--" + key.name + "=" + value);
            return simulated(arguments);
        };
        // The unit that a bound is written in.
        std::size_t digits = 0;
        const double top = std::stod(high, &digits), bottom = std::stod(low);
        const auto unit = high.substr(digits);
        const auto written = [&](double v) { return fmt::format("{:.12g}{}", v, unit); };
        INFO(key.name << " " << key.accepted);
        CHECK_NOTHROW(validate(scene(high).scene));
        if (kind == "from") CHECK_NOTHROW(validate(scene(low).scene));
        const double beyond = std::max(1e-6 * std::abs(top), 1e-6);
        if (key.value != "COUNT" && !key.value.starts_with("COUNT|")) {
            CHECK_THAT(refusal([&] { scene(written(top + beyond)); }), Contains(key.name) && Contains(key.accepted));
            if (low.ends_with(unit))
                CHECK_THAT(refusal([&] { scene(written(bottom - 1e-6 * std::max(1e-3, std::abs(bottom)))); }),
                           Contains(key.name) && Contains(key.accepted));
        } else {
            CHECK_THAT(refusal([&] { scene(fmt::format("{}", static_cast<std::int64_t>(top) + 1)); }),
                       Contains(key.name));
        }
        ++checked;
    }
    CHECK(checked > 25);
}

TEST_CASE("of what the C library is told only its fused multiply-adds change", "[options]") {
    const auto said = [](const char* tunables) { return without_fma(tunables); };
    CHECK(said("") == "glibc.cpu.hwcaps=-FMA,-FMA4");
    CHECK(said("glibc.malloc.check=3") == "glibc.malloc.check=3:glibc.cpu.hwcaps=-FMA,-FMA4");
    CHECK(said("glibc.cpu.hwcaps=-AVX2,-FMA") == "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4");
    // The last of two settings is the one that counts.
    CHECK(said("glibc.cpu.hwcaps=-AVX2:glibc.malloc.check=3:glibc.cpu.hwcaps=-ERMS") ==
          "glibc.malloc.check=3:glibc.cpu.hwcaps=-ERMS,-FMA,-FMA4");
    for (const char* already :
         {"glibc.cpu.hwcaps=-FMA,-FMA4", "glibc.malloc.check=3:glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4"})
        CHECK(said(already) == already);
}
