// `wedgescope evaluate` from outside: the models' values against those that their sources print, tables, units, refusals.
#include <catch2/catch.hpp>

#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>
#include <regex>
#include <set>
#include <thread>

#include "tests/file_content.hpp"
#include "tests/in_process.hpp"
#include "tests/json.hpp"

namespace {

using wedgescope::test::content;

namespace fs = std::filesystem;
using Catch::Matchers::Contains;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;
using Strings = std::vector<std::string>;

struct Outcome {
    int code = 0;
    std::string out, err;
    std::uint64_t peak_rss_bytes = 0;
};

/// A folder of its own for each test, gone with it.
class Folder {
public:
    Folder() {
        static int number = 0;
        path_ = fs::temp_directory_path() /
                ("evaluate_test_" + std::to_string(::getpid()) + "_" + std::to_string(++number));
        fs::create_directories(path_ / "work");
    }
    ~Folder() { fs::remove_all(path_); }
    std::string file(const std::string& name) const { return (path_ / "work" / name).string(); }
    std::string write(const std::string& name, const std::string& text) const {
        std::ofstream(file(name), std::ios::binary) << text;
        return file(name);
    }
    std::size_t files() const {
        return static_cast<std::size_t>(std::distance(fs::directory_iterator(path_ / "work"), {}));
    }
    /// `wedgescope evaluate` and these words, in the test's own process.
    Outcome run(Strings words) const {
        words.insert(words.begin(), "evaluate");
        const std::string out_path = (path_ / "out").string();
        const wedgescope::test::Ended ended = wedgescope::test::run_here(words, (path_ / "err").string(), out_path);
        return {ended.code, content(out_path), ended.err, 0};
    }
    /// The same as a process of its own.
    Outcome start(Strings words, const std::string& out = "", const std::string& in = "") const {
        words.insert(words.begin(), {WEDGESCOPE_PROGRAM, "evaluate"});
        const std::string err_path = (path_ / "err").string(), out_path = out.empty() ? (path_ / "out").string() : out;
        const wedgescope::test::Ended ended =
            wedgescope::test::wait_for(wedgescope::test::start(words, err_path, out_path, in), err_path);
        return {ended.code, out.empty() ? content(out_path) : "", ended.err, ended.peak_rss_bytes};
    }
    /// Refused with one line on standard error and nothing else; that line.
    std::string refusal(const Strings& words, int code = 2) const {
        const Outcome outcome = run(words);
        CHECK(outcome.code == code);
        CHECK(std::count(outcome.err.begin(), outcome.err.end(), '\n') == 1);
        CHECK(outcome.err.starts_with("wedgescope: "));
        CHECK(outcome.out.empty());
        return outcome.err;
    }

private:
    fs::path path_;
};

Strings split(const std::string& text, char at) {
    Strings parts;
    std::istringstream in(text);
    for (std::string part; std::getline(in, part, at);) parts.push_back(part);
    if (!text.empty() && text.back() == at && at == ',') parts.emplace_back();
    return parts;
}

struct Value {
    double number = 0;
    std::string unit;
};

/// What single values give: name -> value.
std::map<std::string, Value> values(const std::string& model, const std::string& words) {
    const Folder folder;
    Strings all{model};
    for (const std::string& word : split(words, ' ')) all.push_back(word);
    const Outcome outcome = folder.run(all);
    INFO(model << " " << words << "\n" << outcome.err);
    REQUIRE(outcome.code == 0);
    REQUIRE(outcome.err.empty());
    std::map<std::string, Value> found;
    for (const std::string& line : split(outcome.out, '\n')) {
        const auto equals = line.find(" = ");
        REQUIRE(equals != std::string::npos);
        std::istringstream rest(line.substr(equals + 3));
        Value value;
        rest >> value.number;
        REQUIRE(rest);
        rest >> value.unit;
        found[line.substr(0, equals)] = value;
    }
    return found;
}

double value(const std::string& model, const std::string& words, const std::string& output) {
    const auto all = values(model, words);
    REQUIRE(all.count(output));
    return all.at(output).number;
}

/// The cells of a table that the program wrote, header first.
std::vector<Strings> table(const std::string& text) {
    std::vector<Strings> rows;
    for (const std::string& line : split(text, '\n')) rows.push_back(split(line, ','));
    return rows;
}

nlohmann::json listed() {
    const Folder folder;
    const Outcome outcome = folder.run({"--list", "--json"});
    REQUIRE(outcome.code == 0);
    return wedgescope::test::json_of(outcome.out);
}

}  // namespace

// ------------------------------------------------------------------------------------------------------- documents

namespace {

/// A row of a table of the documents whose last cell says what computes it: `MODEL values` outputs; `MODEL values` outputs ...
struct DocumentedRow {
    std::string text;
    Strings numbers;  ///< as printed, of the cells between
    struct Computed {
        std::string model, words, output;
    };
    std::vector<Computed> computed;
};

Strings matches(const std::string& text, const std::string& pattern) {
    Strings found;
    const std::regex expression(pattern);
    for (std::sregex_iterator i(text.begin(), text.end(), expression), end; i != end; ++i) found.push_back(i->str());
    return found;
}

std::vector<DocumentedRow> documented_rows(const std::string& path) {
    std::vector<DocumentedRow> rows;
    for (const std::string& line : split(content(path), '\n')) {
        Strings cells = split(line, '|');
        if (!line.starts_with("| ") || !line.ends_with("|") || cells.size() < 4 || !cells.back().starts_with(" `"))
            continue;
        DocumentedRow row{line, {}, {}};
        for (std::size_t i = 2; i + 1 < cells.size(); ++i)
            for (const std::string& number : matches(cells[i], R"([-+]?\b[0-9]+(\.[0-9]+)?(e[-+]?[0-9]+)?\b)"))
                row.numbers.push_back(number);
        const std::string& last = cells.back();
        for (std::size_t begin = last.find('`'); begin != std::string::npos;) {
            const std::size_t end = last.find('`', begin + 1), next = last.find('`', end + 1),
                              space = last.find(' ', begin);
            const std::string model = last.substr(begin + 1, space - begin - 1),
                              words = last.substr(space + 1, end - space - 1);
            for (const std::string& output : matches(last.substr(end + 1, next - end - 1), "[A-Za-z0-9_]+"))
                row.computed.push_back({model, words, output});
            begin = next;
        }
        rows.push_back(std::move(row));
    }
    return rows;
}

/// One unit of the last digit of a printed number.
double last_digit(const std::string& number) {
    const auto e = number.find('e'), point = number.find('.');
    const std::size_t end = e == std::string::npos ? number.size() : e;
    const double decimals = point == std::string::npos ? 0 : static_cast<double>(end - point - 1);
    const double exponent = e == std::string::npos ? 0 : std::stod(number.substr(e + 1));
    return std::pow(10.0, exponent - decimals);
}

}  // namespace

TEST_CASE("the tables of the documents are what their own commands compute", "[quick]") {
    std::set<std::string> models;
    std::size_t values_held = 0;
    std::vector<DocumentedRow> rows = documented_rows(WEDGESCOPE_DOCS "/physics.md");
    const std::vector<DocumentedRow> of_paper = documented_rows(WEDGESCOPE_DOCS "/paper.md");
    CHECK(of_paper.size() == 4);
    rows.insert(rows.end(), of_paper.begin(), of_paper.end());
    for (const DocumentedRow& row : rows) {
        INFO(row.text);
        REQUIRE(!row.computed.empty());
        REQUIRE(row.numbers.size() >= row.computed.size());
        const std::size_t first = row.numbers.size() - row.computed.size();
        for (std::size_t i = 0; i < row.computed.size(); ++i) {
            const auto& [model, words, output] = row.computed[i];
            const std::string& printed = row.numbers[first + i];
            INFO(model << " " << words << ": " << output << ", printed " << printed);
            CHECK_THAT(value(model, words, output), WithinAbs(std::stod(printed), 1.0001 * last_digit(printed)));
            models.insert(model);
            ++values_held;
        }
    }
    CHECK(values_held >= 70);
    CHECK(models.size() >= 20);
}

// ------------------------------------------------------------------------------------------------------- values

TEST_CASE("the self-check values of the physics reference come out", "[evaluate][quick]") {
    // Section 11, to the digits printed there.
    const auto sight = values("sight", "hs=3000m h=250m s=20km");
    CHECK_THAT(sight.at("r").number, WithinAbs(20191.962666, 1e-6));
    CHECK(sight.at("r").unit == "m");
    CHECK_THAT(sight.at("delta").number, WithinAbs(7.895043, 1e-6));
    CHECK(sight.at("delta").unit == "deg");
    CHECK_THAT(sight.at("psi").number, WithinAbs(7.760145, 1e-6));
    CHECK_THAT(value("horizon", "h=3000m", "s_h"), WithinAbs(225727.878, 1e-3));
    const auto published = values("arc", "hs=300m h=0 r=1km k=1 R=8477.362km");
    CHECK_THAT(published.at("delta").number, WithinAbs(17.4608, 5e-5));
    CHECK_THAT(published.at("psi").number, WithinAbs(17.4544, 5e-5));
    const auto geodesic = values("geodesic-inverse", "lat1=40.6deg lon1=-73.8deg lat2=51.6deg lon2=-0.5deg");
    CHECK_THAT(geodesic.at("s").number, WithinAbs(5551759.400, 1e-3));
    CHECK_THAT(geodesic.at("az1").number, WithinAbs(51.198883, 1e-6));
    CHECK_THAT(geodesic.at("az2").number, WithinAbs(107.821777, 1e-6));
    // 2.2 in the text.
    CHECK_THAT(value("noise", "F=0 B=1Hz", "P_n_dBm"), WithinAbs(-173.975, 5e-4));
    // 3: the first sidelobe of a uniform aperture.
    const double phi = 4.493409457909 / (2 * 1.39155737825151) * 1.5;
    CHECK_THAT(value("antenna-azimuth", "pattern=uniform theta_3=1.5deg phi=" + std::to_string(phi) + "deg", "g_az_dB"),
               WithinAbs(-13.26, 5e-3));
    CHECK_THAT(value("cell-area", "r=1km psi=5deg theta_3=1deg", "theta_2"), WithinAbs(0.752692, 5e-7));
}

TEST_CASE("the self-check values of land, sea and statistics come out", "[evaluate][quick]") {
    CHECK_THAT(value("nrl-sea", "f=3.2GHz pol=hh SS=4 psi=2deg", "sigma0_dB"), WithinAbs(-44.3002, 5e-5));
    CHECK_THAT(value("nrl-sea", "f=5.3GHz pol=vv SS=2 psi=1.5deg", "sigma0_dB"), WithinAbs(-47.6606, 5e-5));
    CHECK_THAT(value("git-sea", "f=9GHz pol=hh SS=4 psi=2deg phi=90deg", "sigma0_dB"), WithinAbs(-35.5455, 5e-5));
    CHECK_THAT(value("git-sea", "f=9GHz pol=vv SS=4 psi=2deg phi=-90deg", "sigma0_dB"), WithinAbs(-34.0853, 5e-5));
    CHECK_THAT(value("ulaby-dobson", "class=soil f=10GHz pol=hh psi=55deg", "sigma0_dB"), WithinAbs(-8.4245, 5e-5));
    CHECK_THAT(value("ulaby-dobson", "class=grass f=15GHz pol=vv psi=45deg", "sigma0_dB"), WithinAbs(-13.8618, 5e-5));
    std::ostringstream roughness;  // k s = 0.8 at 10 GHz
    roughness.precision(17);
    roughness << "s_rms=" << 0.8 * 0.0299792458 / (2 * std::numbers::pi) << "m";
    const auto oh = values("oh", "eps_re=10 eps_im=2 f=10GHz psi=55deg " + roughness.str());
    CHECK_THAT(oh.at("vv_dB").number, WithinAbs(-10.5666, 5e-5));
    CHECK_THAT(oh.at("hh_dB").number, WithinAbs(-11.9123, 5e-5));
    CHECK_THAT(oh.at("hv_dB").number, WithinAbs(-22.3370, 5e-5));
    const auto water = values("water", "f=10.7GHz t=15degC S=32ppt");
    CHECK_THAT(water.at("eps_re").number, WithinAbs(51.4263, 5e-5));
    CHECK_THAT(water.at("eps_im").number, WithinAbs(39.6006, 5e-5));
    const auto fresnel = values("fresnel", "eps_re=51.4263 eps_im=39.6006 inc=50deg");
    CHECK_THAT(fresnel.at("e_H").number, WithinAbs(0.261614, 1e-6));
    CHECK_THAT(fresnel.at("e_V").number, WithinAbs(0.520293, 1e-6));
    CHECK_THAT(value("k-shape", "psi=2deg A_c=1000m^2 pol=vv", "nu"), WithinAbs(4.849385, 5e-7));
    CHECK_THAT(value("k-distribution", "nu=1.5 x=2", "P"), WithinAbs(0.1397314, 5e-8));
    const auto one = values("speckle", "N=1"), four = values("speckle", "N=4");
    CHECK_THAT(one.at("mean_dB").number, WithinAbs(-2.507, 5e-4));
    CHECK_THAT(one.at("std_dB").number, WithinRel(10 / std::numbers::ln10 * std::numbers::pi / std::sqrt(6), 1e-12));
    CHECK(four.at("std").number == 0.5);
    CHECK_THAT(four.at("mean_dB").number,
               WithinRel(10 / std::numbers::ln10 * (11.0 / 6 - std::numbers::egamma - std::log(4)), 1e-12));
}

TEST_CASE("the self-check values of air, rain and cloud come out", "[evaluate][quick]") {
    const auto ten = values("gases", "f=10GHz p=1013.25hPa T=288.15K rho=7.5g/m^3");
    CHECK_THAT(ten.at("gamma_o").number, WithinAbs(0.008224417, 5e-10));
    CHECK_THAT(ten.at("gamma_w").number, WithinAbs(0.005974125, 5e-10));
    CHECK(ten.at("gamma").unit == "dB/km");
    const auto sixty = values("gases", "f=60GHz");
    CHECK_THAT(sixty.at("gamma_o").number, WithinAbs(14.6234748, 5e-8));
    CHECK_THAT(sixty.at("gamma_w").number, WithinAbs(0.1548418, 5e-8));
    // ITU's own validation example.
    CHECK_THAT(value("gases", "f=12GHz", "gamma_o"), WithinRel(0.00869826406877357, 1e-9));
    CHECK_THAT(value("gases", "f=12GHz", "gamma_w"), WithinRel(0.00953538822024593, 1e-9));
    const auto air = values("standard-air", "h=4km");
    CHECK_THAT(air.at("T").number, WithinAbs(262.16635, 5e-6));
    CHECK_THAT(air.at("p").number, WithinAbs(616.60439, 5e-6));
    CHECK_THAT(air.at("rho").number, WithinAbs(1.015015, 5e-7));
    const auto circular = values("rain", "f=16GHz R=heavy t_pol=45deg");
    CHECK_THAT(circular.at("k_R").number, WithinAbs(0.05590463, 5e-9));
    CHECK_THAT(circular.at("alpha").number, WithinAbs(1.06570970, 5e-9));
    CHECK_THAT(circular.at("gamma_R").number, WithinRel(0.05590463 * std::pow(16, 1.06570970), 1e-6));
    const auto itu = values("rain", "f=14.25GHz R=26.48052mm/h el=31.076991235657deg");
    CHECK_THAT(itu.at("k_R").number, WithinRel(0.0397548797329313, 1e-9));
    CHECK_THAT(itu.at("alpha").number, WithinRel(1.12418042813791, 1e-9));
    CHECK_THAT(itu.at("gamma_R").number, WithinRel(1.58130839366869, 1e-9));
    const auto echo = values("rain-echo", "R=2mm/h f=9GHz");
    CHECK_THAT(echo.at("Z").number, WithinAbs(606.2866, 5e-5));
    CHECK_THAT(echo.at("eta").number, WithinRel(1.401514e-7, 5e-7));
    CHECK(echo.at("ICR").number == 18);
    CHECK(value("rain-echo", "R=16mm/h f=9GHz", "ICR") == Approx(15).epsilon(1e-12));
    CHECK(value("cloud", "f=30GHz T=280K M=0.0005kg/m3", "gamma_c") ==
          value("cloud", "f=30GHz T=280K M=0.5g/m^3", "gamma_c"));
    CHECK(value("rain", "f=10GHz R=1in/h", "gamma_R") == value("rain", "f=10GHz R=25.4mm/h", "gamma_R"));
    const auto cloud = values("cloud", "f=30GHz T=280K M=0.5g/m^3");
    CHECK_THAT(cloud.at("K_l").number, WithinAbs(0.6419384, 5e-8));
    CHECK_THAT(cloud.at("gamma_c").number, WithinRel(0.5 * cloud.at("K_l").number, 1e-15));
    // Along a level ray just above a plane all media are even: twice the length times the attenuation.
    const auto loss =
        values("path-loss", "hs=0 delta=0 r=10km k=flat f=10GHz R=moderate M=0.05g/m^3 h_b=-10m h_c=10m h_R=1km");
    CHECK_THAT(loss.at("A_g").number, WithinRel(20 * (0.008224417 + 0.005974125), 1e-6));
    CHECK_THAT(loss.at("A_R").number, WithinRel(20 * value("rain", "R=4mm/h f=10GHz", "gamma_R"), 1e-9));
    CHECK_THAT(loss.at("A_c").number, WithinRel(20 * value("cloud", "T=288.15K f=10GHz", "gamma_c"), 1e-9));
    CHECK(loss.at("L_a").number == Approx(loss.at("A_g").number + loss.at("A_R").number + loss.at("A_c").number));
    CHECK(value("path-loss", "hs=0 delta=0 r=10km rho0=none f=10GHz", "L_a") == 0);
}

TEST_CASE("the other models of land and sea, worked by hand", "[evaluate][quick]") {
    const auto rad = [](double deg) { return deg * std::numbers::pi / 180; };
    const auto db = [](double ratio) { return 10 * std::log10(ratio); };
    CHECK_THAT(value("git-land", "class=grass f=10GHz psi=10deg", "sigma0_dB"),
               WithinRel(db(0.023 * std::pow(rad(10) + 0.012, 1.5)), 1e-12));
    const double u = std::sqrt(3) / 4.7, b0 = 0.4, lambda = 0.299792458 / 3, t0 = std::tan(b0);
    const double peak = u / (t0 * t0) * std::exp(-std::pow(std::tan(rad(90 - 80)) / t0, 2));
    CHECK_THAT(value("morchin", "class=wooded-hills f=3GHz psi=80deg", "sigma0"),
               WithinRel(0.0126 * std::sin(rad(80)) / lambda + peak, 1e-12));
    const auto low = values("billingsley", "delta=1deg");
    CHECK(low.at("sigma0_dB").number == -30);
    CHECK(low.at("a_w").number == 3.0);
    const double tan2 = std::pow(std::tan(rad(10)), 2), cos4 = std::pow(std::cos(rad(10)), 4);
    CHECK_THAT(value("quasi-specular", "Gamma_0=0.6 mss=0.03 psi=80deg", "sigma0"),
               WithinRel(0.6 / 0.03 / cos4 * std::exp(-tan2 / 0.03), 1e-12));
    // Scenes take NRL up to 60 degrees.
    CHECK(value("sea", "f=16.5GHz pol=vv SS=3 psi=20deg", "sigma0_dB") ==
          value("nrl-sea", "f=16.5GHz pol=vv SS=3 psi=20deg", "sigma0_dB"));
    // Below that as scenes have it: in proportion to the sine; and a sea without waves returns nothing.
    CHECK_THAT(value("sea", "f=16.5GHz pol=vv SS=3 psi=0.1deg", "sigma0") /
                   value("sea", "f=16.5GHz pol=vv SS=3 psi=0.01deg", "sigma0"),
               WithinRel(10, 1e-5));
    CHECK_THAT(Folder().run({"sea", "f=16.5GHz", "SS=0", "psi=80deg"}).out, Contains("sigma0 = 0\n"));
    const auto waves = values("sea-state", "SS=3");
    const double wind = 3.16 * std::pow(3, 0.8);
    CHECK_THAT(waves.at("V").number, WithinRel(wind, 1e-14));
    CHECK_THAT(waves.at("h_av").number, WithinRel(4.52e-3 * std::pow(wind, 2.5), 1e-14));
    CHECK_THAT(waves.at("h_13").number, WithinRel(0.04 + 0.1 * std::pow(3, 2.1), 1e-14));
    CHECK_THAT(waves.at("mss").number, WithinRel(0.003 + 5.12e-3 * wind, 1e-14));
    // Upwind against downwind as GIT has it, whose own mean it is taken over.
    CHECK_THAT(
        value("sea-wind", "f=9GHz psi=2deg phi=0", "D_dB") - value("sea-wind", "f=9GHz psi=2deg phi=180deg", "D_dB"),
        WithinAbs(value("git-sea", "f=9GHz SS=4 psi=2deg phi=0", "sigma0_dB") -
                      value("git-sea", "f=9GHz SS=4 psi=2deg phi=180deg", "sigma0_dB"),
                  1e-9));
    // Edge-on water mirrors all: 1 + 4 + 1; waves take it away.
    const auto shore = values("far-shore", "f=16.5GHz psi=0.05deg h_b=2m");
    CHECK_THAT(shore.at("F4").number, WithinAbs(6, 0.01));
    CHECK_THAT(shore.at("d_w").number, WithinRel(2 / std::tan(rad(0.05)), 1e-12));
    CHECK_THAT(value("far-shore", "f=16.5GHz psi=0.01deg h_b=2m", "d_w"), WithinRel(2 / std::tan(rad(0.01)), 1e-12));
    CHECK(value("far-shore", "f=16.5GHz psi=5deg sigma_h=1m", "F4") == 1);
    // GIT's wind and waves are those of the sea state unless they are given.
    CHECK_THAT(value("git-sea", "f=9GHz SS=1 psi=2deg V=9.579329m/s h_av=1.283737m", "sigma0_dB"),
               WithinAbs(value("git-sea", "f=9GHz SS=4 psi=2deg", "sigma0_dB"), 1e-3));
}

TEST_CASE("geometry: rays, ways back and the ellipsoid agree with closed forms", "[evaluate][quick]") {
    // There and back.
    CHECK_THAT(value("arc", "hs=3000m h=250m r=20191.962666m", "s"), WithinAbs(20000, 1e-5));
    const auto ray = values("ray", "hs=3000m delta=7.895043deg t=20191.962666m");
    CHECK_THAT(ray.at("h").number, WithinAbs(250, 2e-4));  // half a unit of the seventh digit of delta, at 20 km
    CHECK_THAT(ray.at("s").number, WithinAbs(20000, 1e-4));
    const auto end = values("geodesic-direct", "lat1=40.6deg lon1=-73.8deg az1=51.198883deg s=5551759.4m");
    CHECK_THAT(end.at("lat2").number, WithinAbs(51.6, 1e-6));
    CHECK_THAT(end.at("lon2").number, WithinAbs(-0.5, 1e-6));
    // The longest there is, from pole to pole, leads there.
    const double longest = value("geodesic-inverse", "lat1=90deg lon1=0deg lat2=-90deg lon2=0deg", "s");
    CHECK_THAT(value("geodesic-direct", "lat1=90deg lon1=0deg az1=0deg s=" + std::to_string(longest) + "m", "lat2"),
               WithinAbs(-90, 1e-6));
    // A 3-4-5 triangle over a plane.
    const auto plane = values("sight", "hs=700m h=400m s=400m k=flat");
    CHECK(plane.at("r").number == 500);
    CHECK_THAT(plane.at("delta").number, WithinRel(std::asin(0.6) * 180 / std::numbers::pi, 1e-15));
    CHECK(plane.at("theta").number == 0);
    // 4/3 earth rule of the published form, three digits.
    CHECK_THAT(value("horizon", "h=100m", "s_h"), WithinRel(41200, 1e-3));
    const auto two = values("horizon", "h=100m h_t=400m");
    CHECK_THAT(two.at("s_t").number, WithinRel(3 * two.at("s_h").number, 1e-5));
    CHECK_THAT(two.at("t_h").number, WithinRel(std::sqrt(100 * (8.0 / 3 * 6371008.7714 + 100)), 1e-14));
    // NIMA TR8350.2: b^2/a and a at the equator.
    const auto radii = values("earth-radius", "lat=0 A=90deg");
    CHECK_THAT(radii.at("M").number, WithinAbs(6356752.3142 * 6356752.3142 / 6378137, 1e-3));
    CHECK_THAT(radii.at("R").number, WithinAbs(6378137, 1e-8));
    CHECK_THAT(radii.at("Re").number, WithinAbs(6378137 / 3.0 * 4, 1e-8));
}

TEST_CASE("antenna patterns fall to half where they should, and follow their laws", "[evaluate][quick]") {
    CHECK_THAT(value("antenna-azimuth", "phi=0.75deg theta_3=1.5deg", "g_az"), WithinRel(0.5, 1e-14));
    CHECK_THAT(value("antenna-azimuth", "phi=-0.75deg theta_3=1.5deg pattern=uniform", "g_az"), WithinRel(0.5, 1e-12));
    CHECK(value("antenna-azimuth", "phi=0 theta_3=1.5deg pattern=uniform", "g_az_dB") == 0);
    CHECK_THAT(value("antenna-elevation", "delta=-1deg beta_0=5deg theta_el=12deg", "g_el"), WithinRel(0.5, 1e-14));
    const auto rad = [](double deg) { return deg * std::numbers::pi / 180; };
    const double csc2 = std::pow(std::sin(rad(5)) / std::sin(rad(27)), 2);
    CHECK_THAT(value("antenna-elevation", "delta=30deg tilt=3deg", "g_el"), WithinRel(csc2, 1e-13));
    CHECK_THAT(value("antenna-elevation", "delta=30deg tilt=3deg antenna=cos-csc2 p=1", "g_el_dB"),
               WithinRel(10 * std::log10(csc2 * std::cos(rad(27)) / std::cos(rad(5))), 1e-12));
    CHECK(value("antenna-elevation", "delta=-90deg", "g_el_dB") == -60);
    // More than 90 degrees below the axis.
    for (const std::string antenna : {"csc2", "cos-csc2"}) {
        CHECK(value("antenna-elevation", "delta=20deg tilt=-75deg antenna=" + antenna, "g_el_dB") == -60);
        CHECK(value("antenna-elevation", "delta=10deg tilt=-75deg antenna=" + antenna, "g_el_dB") > -55);
    }
    CHECK(value("antenna-elevation", "delta=30deg tilt=3deg", "beta") == Approx(27).epsilon(1e-15));
}

TEST_CASE("no arc is longer than half the way round", "[evaluate]") {
    const Folder folder;
    CHECK(folder.run({"sight", "hs=1km", "h=0", "s=15000km", "k=1"}).code == 0);
    CHECK_THAT(folder.refusal({"sight", "hs=1km", "h=0", "s=20000km", "k=0.1"}), Contains("half the way round"));
}

TEST_CASE("an antenna's file is a law of its own", "[evaluate]") {
    const Folder folder;
    const std::string file = folder.write("dish.csv", "# a dish\ndepression_deg,gain_db\n-10,-30\n0,0\n20,-10\n");
    const auto g_db = [&](const std::string& delta) {
        const Outcome one = folder.run({"antenna-elevation", "delta=" + delta, "antenna=" + file, "tilt=2deg"});
        INFO(one.err);
        REQUIRE(one.code == 0);
        return std::stod(one.out.substr(one.out.find("g_el_dB = ") + 10));
    };
    CHECK(g_db("2deg") == Approx(0).margin(1e-12));
    CHECK(g_db("12deg") == Approx(-5));
    CHECK(g_db("-3deg") == Approx(-15));
    CHECK(g_db("23deg") == Approx(-60));
    // For all rows of a table; and its name in a table of one row.
    const std::string rows = folder.write("rays.csv", "delta [deg]\n2\n12\n");
    const Outcome many = folder.run({"antenna-elevation", "antenna=" + file, "tilt=2deg", "--in", rows});
    CHECK(many.code == 0);
    CHECK_THAT(table(many.out).at(2).back(), Contains("-5"));
    CHECK(folder.run({"antenna-elevation", "delta=12deg", "antenna=" + file, "-o", folder.file("one.csv")}).code == 0);
    CHECK_THAT(content(folder.file("one.csv")), Contains(file));
    // A name with a comma is one cell.
    const std::string odd = folder.write("dish,2.csv", "depression_deg,gain_db\n-10,-30\n0,0\n");
    const Outcome quoted = folder.run({"antenna-elevation", "delta=12deg", "antenna=" + odd, "-o", "-"});
    CHECK(quoted.code == 0);
    CHECK_THAT(quoted.out, Contains(",\"" + odd + "\","));
    CHECK_THAT(folder.refusal({"antenna-elevation", "delta=0", "antenna=csc3"}),
               Contains("antenna is 'csc3'") && Contains("no such file") && Contains("did you mean csc2?"));
    const std::string bad = folder.write("bad.csv", "0,0\n1,2\n");
    CHECK_THAT(folder.refusal({"antenna-elevation", "delta=0", "antenna=" + bad}),
               Contains("bad.csv', line 2: the gain is 2 dB"));
}

TEST_CASE("the radar equation, worked by hand", "[evaluate][quick]") {
    // P_t G^2 g^2 lambda^2 sigma / ((4 pi)^3 r^4 L_s L_a) in decibels over a milliwatt.
    const double lambda = 299792458 / 9.4e9, r = 37040;
    const auto expected = [&](double sigma, double more_db) {
        return 10 * std::log10(25e3 * 1e3 * lambda * lambda * sigma / std::pow(4 * std::numbers::pi, 3) /
                               std::pow(r, 4)) +
               2 * 31 - 4 + more_db;
    };
    const std::string set = " r=20nmi f=9.4GHz P_t=25kW G_0=31dB L_s=4dB";
    const auto point = values("echo-point", "sigma=10m^2" + set + " g_el_dB=-3dB g_az_dB=-1dB L_a=0.5dB");
    CHECK_THAT(point.at("P_r_dBm").number, WithinRel(expected(10, -8.5), 1e-12));
    CHECK(point.at("P_r").unit == "W");
    CHECK_THAT(10 * std::log10(point.at("P_r").number) + 30, WithinRel(point.at("P_r_dBm").number, 1e-13));
    // Ground in a cell: pulse-limited at 5 degrees, beam-limited at 89.
    const double theta_2 = 1.2 * std::numbers::pi / 180 * std::sqrt(std::numbers::pi / (8 * std::numbers::ln2));
    const double psi = 5 * std::numbers::pi / 180;
    const double cell = r * theta_2 * (299792458 * 0.25e-6 / 2) / std::cos(psi);
    const auto area = values("echo-area", "sigma0_dB=-23dB psi=5deg theta_3=1.2deg tau=0.25us theta_el=10deg" + set);
    CHECK_THAT(area.at("A").number, WithinRel(cell, 1e-13));
    CHECK_THAT(area.at("P_r_dBm").number, WithinRel(expected(cell * std::pow(10, -2.3), 0), 1e-12));
    const auto steep = values("cell-area", "r=20nmi psi=89.9deg theta_3=1.2deg theta_el=1deg tau=2us");
    const double beam = r * r * theta_2 * theta_2 / 1.2 / std::sin(89.9 * std::numbers::pi / 180);
    CHECK_THAT(steep.at("A_beam").number, WithinRel(beam, 1e-13));
    CHECK(steep.at("A").number == steep.at("A_beam").number);
    CHECK(steep.at("A_pulse").number > beam);
    // Constant gamma: trees are -12 dB at 10 GHz.
    const auto trees = values("constant-gamma", "gamma10_dB=trees f=16.5GHz psi=5deg");
    CHECK_THAT(trees.at("sigma0_dB").number,
               WithinRel(-12 + 5 * std::log10(1.65) + 10 * std::log10(std::sin(psi)), 1e-13));
    CHECK(values("constant-gamma", "gamma10_dB=-12dB f=16.5GHz psi=5deg").at("sigma0").number ==
          trees.at("sigma0").number);
    const auto bins = values("bins", "theta_3=1.5deg tau=0.5us");
    CHECK(bins.at("N_az").number == 960);
    CHECK(bins.at("da").number == 0.375);
    CHECK(bins.at("dr").number == 299792458 * 0.5e-6 / 8);
    CHECK(bins.at("w").number == 4);
}

TEST_CASE("noise, STC and the display chain, worked by hand", "[evaluate][quick]") {
    const auto noise = values("noise", "F=8dB tau=0.5us SN_min=3dB");
    CHECK(noise.at("B_n").number == 2.4e6);
    const double dbm = 10 * std::log10(1.380649e-23 * 290 * 2.4e6) + 30 + 8;
    CHECK_THAT(noise.at("P_n_dBm").number, WithinRel(dbm, 1e-13));
    CHECK_THAT(noise.at("MDS").number, WithinRel(dbm + 3, 1e-13));
    CHECK(noise.at("MDS").unit == "dBm");
    CHECK(value("noise", "B=1MHz", "B_n") == 1e6);
    CHECK(value("stc", "r=5nmi r_stc=20nmi", "A_stc") == 24.082);  // 40 log10 4 = 24.0824
    CHECK(value("stc", "r=5nmi r_stc=20nmi n=3 A_max=10dB", "A_stc") == 10);
    CHECK(value("stc", "r=30nmi r_stc=20nmi", "A_stc") == 0);
    // 36 dB over the MDS, of which 14 show at 50 dB of IF gain, less 4 of STC: 18 dB of 20.
    const auto levels = values("receiver", "P=-64dBm MDS=-100dBm A_stc=4dB G_if=50dB G_v=0dB D_log=20dB");
    CHECK_THAT(levels.at("v_if").number, WithinAbs(0.9, 1e-12));
    const double video = 0.9 * std::pow(10, -0.2);
    CHECK_THAT(levels.at("v_video").number, WithinRel(video, 1e-7));  // the receiver's gain is a float
    CHECK(levels.at("grey").number == std::floor(255 * video + 0.5));
    CHECK(value("receiver", "P=-64dBm MDS=-100dBm A_stc=4dB G_v=0dB gamma_d=2", "grey") ==
          std::floor(255 * std::sqrt(video) + 0.5));
    CHECK(value("receiver", "P=0 MDS=-100dBm", "grey") == 0);
}

TEST_CASE("display, facets, and what beam and pulse make of an echo, worked by hand", "[evaluate][quick]") {
    const auto rad = [](double deg) { return deg * std::numbers::pi / 180; };
    // A 3-4-5 triangle over a plane.
    CHECK_THAT(value("display", "r=5km hs=3km k=flat", "rho"), WithinRel(4000, 1e-14));
    CHECK(value("display", "r=5km hs=3km display=ppi", "rho") == 5000);
    CHECK(value("display", "r=5km hs=3km display=tdppi", "rho") == 2000);
    CHECK(value("display", "r=5km hs=3km display=tdppi r_d=1km", "rho") == 4000);
    CHECK_THAT(value("display", "r=20191.962666m hs=3000m h_0=250m", "rho"), WithinAbs(20000, 1e-5));
    // Level ground is as it is; ground that rises at 30 degrees against a ray of 10 is met at 40, from behind at -20.
    CHECK_THAT(value("facet", "psi=10deg", "psi_l"), WithinRel(10, 1e-13));
    const std::string rises = "psi=10deg A=90deg dz_dx=" + std::to_string(std::tan(rad(30)));
    CHECK_THAT(value("facet", rises, "psi_l"), WithinAbs(40, 1e-4));
    CHECK_THAT(value("facet", rises, "a_true"), WithinAbs(1 / std::cos(rad(30)), 1e-6));
    CHECK_THAT(value("facet", rises, "a_seen"), WithinAbs(std::sin(rad(40)) / std::cos(rad(30)), 1e-6));
    const std::string falls = "psi=10deg A=270deg dz_dx=" + std::to_string(std::tan(rad(30)));
    CHECK_THAT(value("facet", falls, "psi_l"), WithinAbs(-20, 1e-4));
    CHECK(value("facet", falls, "a_seen") == 0);
    // Across the ray a slope turns the facet but hardly away: sin psi_l = sin psi cos 30.
    CHECK_THAT(value("facet", "psi=10deg A=0deg dz_dx=0.57735026918962576", "psi_l"),
               WithinRel(std::asin(std::sin(rad(10)) * std::cos(rad(30))) * 180 / std::numbers::pi, 1e-12));
    // Half a beamwidth off is a quarter, two-way; straight down cos d is held at 1/2.
    const auto beam = values("beam-weight", "phi=0.75deg theta_3=1.5deg r=100km hs=0 k=flat");
    CHECK(beam.at("cos_d").number == 1);
    CHECK_THAT(beam.at("w").number, WithinRel(0.25, 1e-13));
    const auto steep = values("beam-weight", "phi=1.5deg theta_3=1.5deg r=3km hs=3km");
    CHECK_THAT(steep.at("cos_d").number, WithinRel(0.5, 1e-15));
    CHECK_THAT(steep.at("w").number, WithinRel(0.25, 1e-13));
    CHECK_THAT(value("beam-weight", "phi=1deg r=5km hs=3km k=flat", "cos_d"), WithinRel(0.8, 1e-14));
    double sum = 0;
    for (const char* m : {"0", "1", "2", "3", "4", "5"}) sum += value("pulse-weight", std::string("w=4 m=") + m, "w_m");
    CHECK(sum == 4);
    CHECK(value("pulse-weight", "w=4 m=0", "w_m") == 0.5);
    CHECK(value("pulse-weight", "w=4 m=4", "w_m") == 0.5);
    CHECK(value("pulse-weight", "w=4 m=5", "w_m") == 0);
    CHECK_THAT(value("pulse-weight", "w=0.5 m=0", "w_m"), WithinRel(0.375, 1e-15));
    // Exaggerated threefold: the half-power angle, three times as far out, weighs the same; a third each over 12 bins.
    const auto wide = values("beam-weight", "phi=2.25deg theta_3=1.5deg r=100km hs=0 k=flat s=3");
    CHECK_THAT(wide.at("w").number, WithinRel(beam.at("w").number, 1e-12));
    sum = 0;
    for (int m = 0; m <= 13; ++m) sum += value("pulse-weight", "w=4 s=3 m=" + std::to_string(m), "w_m");
    CHECK_THAT(sum, WithinRel(4.0, 1e-15));
    CHECK_THAT(value("pulse-weight", "w=4 s=3 m=0", "w_m"), WithinRel(0.5 / 3, 1e-15));
    CHECK_THAT(value("pulse-weight", "w=4 s=3 m=11", "w_m"), WithinRel(1.0 / 3, 1e-15));
    // Classes: trees -12 dB and -10 dB of walls at 10 GHz; grass has no walls of its own.
    CHECK_THAT(value("class", "material=trees f=10GHz", "gamma_w_dB"), WithinAbs(-10, 1e-9));
    CHECK_THAT(value("class", "material=trees f=16.5GHz", "gamma_dB"), WithinAbs(-12 + 5 * std::log10(1.65), 1e-9));
    CHECK_THAT(value("class", "material=trees f=10GHz pol=circular", "gamma_dB"), WithinAbs(-15, 1e-9));
    CHECK_THAT(value("class", "material=trees f=10GHz pol=circular", "gamma_w_dB"), WithinAbs(-10.5, 1e-9));
    CHECK(value("class", "material=grass", "gamma_w_dB") == value("class", "material=grass", "gamma_dB"));
    // A Gaussian may look up or straight ahead.
    CHECK(value("antenna-elevation", "delta=0 antenna=gaussian beta_0=0deg", "g_el") == 1);
    CHECK(value("antenna-elevation", "delta=-5deg antenna=gaussian beta_0=-5deg", "g_el") == 1);
}

TEST_CASE("structures add their faces, seen upright, to the ground's return", "[structures]") {
    // 400 on a km2, 15 m wide and 8 m high: n H w = 0.048, 9 % covered; gamma_w of `concrete` 5 dB at 10 GHz.
    const auto added = values("structures", "material=concrete n_km2=400 w=15m H=8m f=10GHz psi=30deg");
    CHECK_THAT(added.at("nHw").number, WithinRel(0.048, 1e-12));
    CHECK_THAT(added.at("share").number, WithinRel(0.09, 1e-12));
    CHECK_THAT(added.at("raised").number, WithinRel(0.72, 1e-12));
    CHECK_THAT(added.at("sigma0_w").number, WithinRel(std::pow(10, 0.5) * 0.048 * std::sqrt(0.75), 1e-12));
    CHECK_THAT(added.at("sigma0").number, WithinRel(0.01 * 0.5, 1e-12));
    // Circular polarisation takes 3 dB of the ground, 0.5 dB of what stands on it.
    const auto round = values("structures", "material=concrete n_km2=400 w=15m H=8m f=10GHz psi=30deg pol=circular");
    CHECK_THAT(round.at("ratio_dB").number - added.at("ratio_dB").number, WithinAbs(2.5, 1e-6));
    const Folder folder;
    CHECK_THAT(folder.refusal({"structures", "material=metal", "psi=5deg"}), Contains("needs n_km2, w and H"));
    CHECK_THAT(folder.refusal({"structures", "material=water", "n_km2=1", "w=1m", "H=1m", "psi=5deg"}),
               Contains("water has no structures"));
}

TEST_CASE("the rain's echo is the radar equation of what a level beam holds", "[evaluate][quick]") {
    // A narrow level Gaussian beam far inside thin rain, nothing taken on the way:
    //   p = K eta theta_2 / r^2 times the integral of the two-way elevation pattern.
    const double lambda = 299792458 / 9e9, r = 20e3, widths = std::sqrt(std::numbers::pi / (8 * std::numbers::ln2));
    const double theta_2 = 1.5 * std::numbers::pi / 180 * widths, elevation_2 = 2 * std::numbers::pi / 180 * widths;
    const double k = 50e3 * 1e3 * 1e3 * std::pow(10, 0.8 - 0.6) * lambda * lambda / std::pow(4 * std::numbers::pi, 3);
    const double eta = value("rain-echo", "R=0.01mm/h f=9GHz", "eta");
    const std::string set =
        "R=0.01mm/h f=9GHz hs=5km h_R=10km antenna=gaussian beta_0=0deg theta_el=2deg rho0=none k=flat ";
    const auto echo = values("rain-volume", set + "r=20km");
    const double expected = k * eta * theta_2 * elevation_2 / (r * r);
    CHECK_THAT(echo.at("p_r").number, WithinRel(expected, 3e-3));  // 0.2 % of the integral, and the drops' own loss
    const double extent = 299792458 * 0.5e-6 / 2;
    CHECK_THAT(echo.at("P_r").number, WithinRel(expected * r * extent / (r - extent), 3e-3));
    CHECK_THAT(echo.at("P_r_dBm").number, WithinAbs(10 * std::log10(echo.at("P_r").number) + 30, 1e-9));
    CHECK_THAT(values("rain-volume", set + "r=20km pol=circular t_pol=0deg").at("p_r").number,
               WithinRel(echo.at("p_r").number * std::pow(10, -1.8), 1e-6));
    // What rain takes of circular polarisation is what it takes at 45 degrees, as in scenes.
    const std::string heavy = "R=heavy f=16.5GHz hs=2km r=20km ";
    CHECK(value("rain-volume", heavy + "pol=circular", "P_r") ==
          value("rain-volume", heavy + "pol=circular t_pol=45deg", "P_r"));
    CHECK(value("rain-volume", heavy, "P_r") == value("rain-volume", heavy + "t_pol=0deg", "P_r"));
    const Folder folder;
    CHECK_THAT(folder.run({"rain-volume", "r=20km", "hs=2km", "R=clear"}).out, Contains("\nP_r = 0 W\n"));
    // Nor do rows on tables made for the row before, whichever input differs.
    const std::vector<std::pair<std::string, std::array<std::string, 2>>> inputs = {{"t_pol [deg]", {"0", "90"}},
                                                                                    {"R [mm/h]", {"4", "40"}},
                                                                                    {"f [GHz]", {"10", "16.5"}},
                                                                                    {"hs [m]", {"2000", "900"}}};
    for (const std::string& model : {std::string("path-loss"), std::string("rain-volume")})
        for (const auto& [input, cells] : inputs) {
            const std::string key = input.substr(0, input.find(' ')),
                              unit = input.substr(input.find('[') + 1, input.find(']') - input.find('[') - 1);
            std::vector<std::string> rest{model, "r=20km"};
            if (model == "path-loss") rest.push_back("delta=1deg");
            for (const auto& [other, of] : inputs)
                if (other != input)
                    rest.push_back(other.substr(0, other.find(' ')) + "=" + of[0] +
                                   other.substr(other.find('[') + 1, other.find(']') - other.find('[') - 1));
            std::vector<std::string> both = rest;
            both.insert(both.end(),
                        {"--in", folder.write("two.csv", input + "\n" + cells[0] + "\n" + cells[1] + "\n")});
            const auto two = table(folder.run(both).out);
            INFO(model << " by " << input);
            REQUIRE(two.size() == 3);
            CHECK(two[1].back() != two[2].back());
            for (const std::size_t row : {0, 1}) {
                std::vector<std::string> one = rest;
                one.insert(one.end(), {"--in", folder.write("one.csv", input + "\n" + cells[row] + "\n")});
                CHECK(table(folder.run(one).out)[1] == two[row + 1]);
            }
        }
    // A table's rows do not hang on each other.
    const auto rows = table(
        folder.run({"rain-volume", "hs=2km", "R=heavy", "--in", folder.write("t.csv", "r [km]\n20\n90\n20\n")}).out);
    REQUIRE(rows.size() == 4);
    CHECK(rows[1] == rows[3]);
    CHECK(std::stod(rows[2][2]) == value("rain-volume", "hs=2km R=heavy r=90km", "P_r"));
}

// ------------------------------------------------------------------------------------------------------- tables

TEST_CASE("a table keeps its columns, and the outputs stand behind them", "[evaluate][quick]") {
    const Folder folder;
    const std::string in = folder.write("t.csv",
                                        "\xef\xbb\xbf# heights of a survey\n"
                                        "\n"
                                        "s [km], site ,h [m],hs [ft],note\r\n"
                                        "20,\"A, north\",250,10000,x\r\n"
                                        "# half-way\n"
                                        "  \n"
                                        "10000m,B,0,3 km,\n");
    const Outcome outcome = folder.run({"sight", "--in", in});
    REQUIRE(outcome.code == 0);
    const Strings lines = split(outcome.out, '\n');
    REQUIRE(lines.size() == 3);
    CHECK(lines[0] == "s [km], site ,h [m],hs [ft],note,r [m],delta [deg],psi [deg],theta [deg]");
    CHECK(lines[1].starts_with("20,\"A, north\",250,10000,x,"));
    CHECK(lines[2].starts_with("10000m,B,0,3 km,,"));
    const auto single = values("sight", "hs=3048m h=250m s=20km");
    CHECK(std::stod(split(lines[1], ',')[6]) == single.at("r").number);  // the note's cell holds a comma
    CHECK(std::stod(split(lines[2], ',')[5]) == value("sight", "hs=3km h=0 s=10km", "r"));
    // Units in round brackets too.
    const std::string round = folder.write("round.csv", "s (km),note (odd),h (m),hs (ft)\n20,x,250,10000\n");
    const Outcome same = folder.run({"sight", "--in", round, "-q"});
    REQUIRE(same.code == 0);
    CHECK(std::stod(split(split(same.out, '\n').at(1), ',').at(4)) == std::stod(split(lines[1], ',')[6]));
    const Outcome old =
        folder.run({"sight", "--in", folder.write("old.csv", "s (km),s (old),h (m),hs (ft)\n20,9,250,10000\n")});
    CHECK(old.code == 0);
    CHECK_THAT(old.err, Contains("stay as they are: 's (old)'"));
    CHECK_THAT(folder.run({"sight", "--in", folder.write("bad.csv", "s (km),h (kg),hs (ft)\n20,250,10000\n")}).err,
               Contains("no column is h; found 's (km)', 'h (kg)'"));
    // What stays is said.
    CHECK(outcome.err == "table '" + in + "': columns that are no input of sight stay as they are: 'site', 'note'\n");
    CHECK(folder.run({"sight", "--in", in, "-q"}).err.empty());
    // Values behind the model hold for every row; a default too.
    const std::string few = folder.write("few.csv", "s [km]\n20\n40\n");
    const auto rows = table(folder.run({"sight", "--in", few, "hs=3048m", "h=250m", "k=4/3"}).out);
    REQUIRE(rows.size() == 3);
    CHECK(std::stod(rows[1][1]) == single.at("r").number);
    CHECK(std::stod(rows[2][1]) == value("sight", "hs=3048m h=250m s=40km", "r"));
    // A table without rows gives one without rows.
    const Outcome none = folder.run({"horizon", "--in", folder.write("none.csv", "h [m]\n")});
    CHECK(none.code == 0);
    CHECK(none.out == "h [m],s_h [m],t_h [m],theta_h [deg],s_t [m]\n");
}

TEST_CASE("every unit of a dimension gives the same answer, in any column order", "[evaluate][quick]") {
    const Folder folder;
    const auto of = [&](const std::string& text) {
        const Outcome outcome = folder.run({"ray", "--in", folder.write("t.csv", text)});
        INFO(outcome.err);
        REQUIRE(outcome.code == 0);
        const Strings cells = table(outcome.out).at(1);
        return std::pair(std::stod(cells.at(cells.size() - 2)), std::stod(cells.back()));
    };
    const auto expected = of("hs [m],delta [deg],t [m]\n3048,1.5,55560\n");
    CHECK(of("t [nmi],hs [ft],delta [deg]\n30,10000,1.5\n") == expected);
    CHECK(of("delta [deg],t [km],hs [kft]\n1.5,55.56,10\n") == expected);
    CHECK(of("delta,t,hs\n1.5deg,30nmi,10000ft\n") == expected);
    const auto radians = of("delta [rad],t [km],hs [m]\n0.026179938779914945,55.56,3048\n");
    CHECK_THAT(radians.first, WithinRel(expected.first, 1e-12));
    const auto frequency = [&](const std::string& text) {
        const Outcome outcome =
            folder.run({"constant-gamma", "gamma10_dB=soil", "psi=3deg", "--in", folder.write("f.csv", text)});
        return std::stod(table(outcome.out).at(1).at(1));
    };
    CHECK(frequency("f [GHz]\n16.5\n") == frequency("f [MHz]\n16500\n"));
    CHECK(frequency("f [GHz]\n16.5\n") == frequency("f [Hz]\n16.5e9\n"));
    CHECK_THAT(frequency("f [GHz]\n16.5\n"), WithinRel(-17 + 5 * std::log10(1.65), 1e-13));
    // Watts and decibels over a milliwatt.
    CHECK(value("receiver", "P=1e-9W MDS=-100dBm", "grey") == value("receiver", "P=-60dBm MDS=-100dBm", "grey"));
}

TEST_CASE("the program says the same as the library, and errors are its exit code", "[evaluate][quick]") {
    const Folder folder;
    const Outcome own = folder.start({"sight", "hs=3000m", "h=250m", "s=20km"});
    CHECK(own.code == 0);
    CHECK(own.out == folder.run({"sight", "hs=3000m", "h=250m", "s=20km"}).out);
    const Outcome bad = folder.start({"sight", "h=0"});
    CHECK(bad.code == 2);
    CHECK(bad.err == folder.run({"sight", "h=0"}).err);
}

TEST_CASE("tables go through pipes, and one model's output is the next one's input", "[evaluate]") {
    const Folder folder;
    const std::string in = folder.write("t.csv", "hs [m],h [m],s [km]\n3000,250,20\n");
    REQUIRE(folder.run({"sight", "--in", in, "-o", folder.file("sight.csv")}).code == 0);
    const Outcome piped = folder.start({"cell-area", "--in", "-", "-q"}, "", folder.file("sight.csv")),
                  named = folder.start({"cell-area", "--in", "/dev/stdin", "-q"}, "", folder.file("sight.csv"));
    INFO(piped.err);
    CHECK(named.out == piped.out);
    REQUIRE(piped.code == 0);
    const auto rows = table(piped.out);
    CHECK(rows.at(0).at(3) == "r [m]");
    CHECK(rows.at(0).back() == "A [m^2]");
    CHECK_THAT(std::stod(rows.at(1).back()),
               WithinRel(value("cell-area", "r=20191.962666m psi=7.760145deg", "A"), 1e-8));
}

TEST_CASE("a signal ends the wait for a table that nobody writes", "[evaluate]") {
    const bool by_name = GENERATE(false, true);
    CAPTURE(by_name);
    const Folder folder;
    const std::string pipe = folder.file("pipe"), err = folder.file("err");
    REQUIRE(::mkfifo(pipe.c_str(), 0600) == 0);
    // Of both kinds: neither end waits for the other, and no end of file comes.
    const int end = ::open(pipe.c_str(), O_RDWR);
    REQUIRE(end >= 0);
    const std::string header = "h [m]\n";
    REQUIRE(::write(end, header.data(), header.size()) == static_cast<ssize_t>(header.size()));
    const pid_t child = wedgescope::test::start(
        {WEDGESCOPE_PROGRAM, "evaluate", "horizon", "--in", by_name ? pipe : "-", "-o", folder.file("out.csv")}, err,
        "/dev/null", by_name ? "/dev/null" : pipe);
    for (int i = 0; i < 2000 && folder.files() < 3; ++i)  // until the output's temporary folder stands
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    REQUIRE(::kill(child, SIGINT) == 0);
    int status = 0;
    pid_t ended = 0;
    for (int i = 0; i < 1000 && (ended = ::waitpid(child, &status, WNOHANG)) == 0; ++i)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    if (ended == 0) ::kill(child, SIGKILL), ::waitpid(child, &status, 0);
    ::close(end);
    CHECK(WIFEXITED(status));
    CHECK(WEXITSTATUS(status) == 130);
    CHECK(content(err) == "wedgescope: stopped by signal 2\n");
    CHECK(folder.files() == 2);
}

TEST_CASE("words are values, and an empty cell takes the default", "[evaluate][quick]") {
    const Folder folder;
    const std::string in =
        folder.write("t.csv", "gamma10_dB,psi [deg],f [GHz]\ntrees,5,10\n-12dB,5,10\nwater,5,10\n-12dB,5,\n");
    const Outcome outcome = folder.run({"constant-gamma", "--in", in});
    REQUIRE(outcome.code == 0);
    const auto rows = table(outcome.out);
    REQUIRE(rows.size() == 5);
    CHECK(rows[1][4] == rows[2][4]);
    // Calm water returns nothing, and that is said.
    CHECK(rows[3] == Strings{"water", "5", "10", "", "", ""});
    CHECK(outcome.err == "table '" + in +
                             "': 1 row of 4 lacks values (empty cells), first line 4: calm water returns nothing; the "
                             "sea models give what waves do\n");
    CHECK(std::stod(rows[4][5]) == value("constant-gamma", "gamma10_dB=-12dB psi=5deg f=16.5GHz", "sigma0_dB"));
    // A pattern that is cut off is a number, but none in decibels.
    CHECK(folder.run({"antenna-azimuth", "phi=10deg", "theta_3=1.5deg"}).out == "g_az = 0\ng_az_dB = no value\n");
    const std::string offsets = folder.write("phi.csv", "phi [deg]\n0\n10\n");
    const Outcome cut = folder.run({"antenna-azimuth", "theta_3=1.5deg", "--in", offsets});
    CHECK(cut.out == "phi [deg],g_az,g_az_dB [dB]\n0,1,0\n10,0,\n");
    CHECK_THAT(cut.err, Contains("1 row of 2 lacks values (empty cells), first line 3: g_az_dB has no value there"));
}

TEST_CASE("what has no solution is an empty cell in a table and a refusal by itself", "[evaluate][quick]") {
    const Folder folder;
    const std::string in = folder.write("t.csv", "r [km],name\n2,near\n4,far\n1,nearer\n");
    const Outcome outcome = folder.run({"arc", "hs=3000m", "h=0", "--in", in, "-q", "-o", folder.file("out.csv")});
    CHECK(outcome.code == 0);
    const auto rows = table(content(folder.file("out.csv")));
    REQUIRE(rows.size() == 4);
    CHECK(rows[1] == Strings{"2", "near", "", "", ""});
    CHECK_THAT(std::stod(rows[2][2]), WithinRel(value("arc", "hs=3km h=0 r=4km", "s"), 1e-15));
    CHECK(rows[3] == Strings{"1", "nearer", "", "", ""});
    CHECK_THAT(
        folder.run({"arc", "hs=3000m", "h=0", "--in", in}).err,
        Contains(
            "2 rows of 3 lack values (empty cells), first line 2: no point of height 0 m is at slant range 2000 m"));
    CHECK_THAT(folder.refusal({"arc", "hs=3000m", "h=0", "r=2km"}), Contains("no point of height 0 m"));
    // So it is whatever the library finds wrong with inputs that are each in range.
    const auto middle_empty = [&](const std::string& model, Strings words, const std::string& text, const char* why) {
        INFO(model);
        words.insert(words.begin(), model);
        words.insert(words.end(), {"--in", folder.write("some.csv", text)});
        const Outcome some = folder.run(words);
        CHECK(some.code == 0);
        CHECK(std::count(some.err.begin(), some.err.end(), '\n') == 1);
        CHECK_THAT(some.err, Contains("1 row of 3 lacks values (empty cells), first line 3: ") && Contains(why));
        const auto all = table(some.out);
        REQUIRE(all.size() == 4);
        CHECK(!all[1].back().empty());
        CHECK(all[2].back().empty());
        CHECK(all[3].back() == all[1].back());
    };
    middle_empty("oh", {"eps_re=10", "psi=55deg", "s_rms=0.004m"}, "f [GHz]\n3\n1\n3\n", "k s");
    middle_empty("path-loss", {"hs=3km", "delta=2deg", "r=30km", "M=0.1g/m^3", "h_b=500m"},
                 "h_c [m]\n1000\n400\n1000\n", "cloud");
    middle_empty("antenna-elevation", {"delta=3deg", "antenna=csc2"}, "beta_0 [deg]\n5\n-5\n5\n", "above 0");
    middle_empty("pulse-weight", {"w=4"}, "m\n1\n1.5\n1\n", "whole numbers");
    middle_empty("display", {"hs=3km"}, "r [km]\n5\n2\n5\n", "the sweep begins at 3000 m");
}

TEST_CASE("results read back the same, or have the digits asked for", "[evaluate][quick]") {
    const Folder folder;
    std::string text = "h [m]\n";
    for (int i = 1; i <= 50; ++i) text += std::to_string(37 * i) + "\n";
    const std::string in = folder.write("t.csv", text);
    const auto all = table(folder.run({"horizon", "--in", in}).out),
               three = table(folder.run({"horizon", "--in", in, "--digits", "3"}).out);
    const double re = 4.0 / 3 * 6371008.7714;
    for (std::size_t i = 1; i <= 50; ++i) {
        const double h = std::stod(all[i][0]), exact = 2 * re * std::asin(std::sqrt(h / (2 * (re + h))));
        CHECK_THAT(std::stod(all[i][1]), WithinRel(exact, 1e-14));
        CHECK_THAT(std::stod(three[i][1]), WithinRel(exact, 5e-3));
        CHECK(three[i][1].size() <= 8);  // 2.26e+05
    }
    CHECK(folder.run({"horizon", "h=3000m", "--digits", "6"}).out.starts_with("s_h = 225728 m\n"));
}

TEST_CASE("digits are those of results, not of what they are of", "[evaluate][quick]") {
    const Folder folder;
    const std::string out = folder.file("out.csv");
    REQUIRE(folder.run({"sight", "hs=3123.456m", "h=250m", "s=20km", "--digits", "2", "-o", out}).code == 0);
    CHECK_THAT(content(out), Contains("3123.456,"));
}

TEST_CASE("a single evaluation can be written as a table of one row", "[evaluate][quick]") {
    const Folder folder;
    const std::string out = folder.file("one.csv");
    REQUIRE(folder.run({"sight", "hs=3000m", "h=250m", "s=20km", "k=flat", "-o", out}).code == 0);
    const auto rows = table(content(out));
    REQUIRE(rows.size() == 2);
    CHECK(rows[0] ==
          Strings{"hs [m]", "h [m]", "s [m]", "k", "R [m]", "r [m]", "delta [deg]", "psi [deg]", "theta [deg]"});
    CHECK(Strings(rows[1].begin(), rows[1].begin() + 5) == Strings{"3000", "250", "20000", "flat", "6371008.7714"});
    CHECK(table(folder.run({"sight", "hs=3000m", "h=250m", "s=20km", "k=flat", "-o", "-"}).out) == rows);
    CHECK_FALSE(fs::exists("-"));
    // It is a table that evaluate takes, but for the outputs.
    std::string back;
    for (std::size_t line = 0; line < 2; ++line)
        for (std::size_t i = 0; i < 5; ++i) back += rows[line][i] + (i < 4 ? "," : "\n");
    const auto again = table(folder.run({"sight", "--in", folder.write("back.csv", back)}).out);
    CHECK(again.at(1) == rows[1]);
}

// ----------------------------------------------------------------------------------------------------- refusals

TEST_CASE("what is wrong with a command line is named", "[evaluate][quick]") {
    const Folder folder;
    CHECK_THAT(folder.refusal({}), Contains("no model is given; wedgescope evaluate --list names them all"));
    CHECK_THAT(folder.refusal({"horzon", "h=3km"}), Contains("unknown model 'horzon'; did you mean horizon?"));
    CHECK_THAT(folder.refusal({"horizon"}),
               Contains("horizon lacks h [m]; give it behind the model (NAME=VALUE, with a unit), or"));
    CHECK_THAT(folder.refusal({"sight", "h=0"}), Contains("sight lacks hs [m], s [m]; give them behind the model"));
    CHECK_THAT(folder.refusal({"horizon", "H=3km"}),
               Contains("horizon has no input 'H'; did you mean h? (it has h, h_t, k, R)"));
    CHECK_THAT(folder.refusal({"horizon", "h=3km", "h=3km"}), Contains("h is given twice"));
    CHECK_THAT(folder.refusal({"horizon", "3km"}),
               Contains("found '3km' behind the model horizon; accepted: NAME=VALUE"));
    CHECK_THAT(
        folder.refusal({"horizon", "h=3000"}),
        Contains("h is '3000'; it must be a number with its unit (m, km, ft, kft, nmi, mi, yd) from 0 m to 1000000 m"));
    CHECK_THAT(folder.refusal({"horizon", "h=-1m"}), Contains("h is '-1m'; it must be"));
    CHECK_THAT(folder.refusal({"horizon", "h=nan"}), Contains("h is 'nan'"));
    CHECK_THAT(folder.refusal({"horizon", "h="}), Contains("h is ''"));
    CHECK_THAT(folder.refusal({"horizon", "h=3deg"}), Contains("h is '3deg'"));
    CHECK_THAT(folder.refusal({"sight", "h=0", "hs=0", "s=0", "k=round"}),
               Contains("k is 'round'; it must be a number from 0.1 to 1000000 or flat"));
    CHECK_THAT(folder.refusal({"sight", "h=0", "hs=0", "s=0", "k=1/0"}), Contains("k is '1/0'"));
    CHECK_THAT(folder.refusal({"antenna-azimuth", "phi=0", "pattern=square"}),
               Contains("pattern is 'square'; it must be one of gaussian or uniform"));
    CHECK_THAT(folder.refusal({"echo-point", "r=1km", "sigma=1m"}),
               Contains("sigma is '1m'; it must be a number with its unit (m^2)"));
    CHECK_THAT(folder.refusal({"stc", "r=0", "r_stc=1km"}), Contains("r is '0'; it must be a number with its unit"));
    CHECK_THAT(folder.refusal({"horizon", "h=3km", "--digits", "18"}),
               Contains("--digits is '18'; a whole number from 1 to 17"));
    CHECK_THAT(folder.refusal({"horizon", "h=3km", "--json"}), Contains("json is given without list"));
    CHECK_THAT(folder.refusal({"--list", "horizon", "sight"}), Contains("list takes one model at most"));
    CHECK_THAT(folder.refusal({"--list", "horizont"}), Contains("did you mean horizon?"));
    CHECK_THAT(folder.refusal({"--list", "--in", "t.csv"}), Contains("in is given with list"));
    CHECK_THAT(folder.refusal({"--list", "horizon", "-o", folder.file("list.csv")}),
               Contains("output (-o) is given with list"));
    CHECK_THAT(folder.refusal({"--list", "--digits", "3"}), Contains("digits is given with list"));
    CHECK_THAT(folder.refusal({"horizon", "--set", "h=3km"}), Contains("unknown option '--set'"));
}

TEST_CASE("what is wrong with a table is named by file, line and column", "[evaluate][quick]") {
    const Folder folder;
    const auto refused = [&](const std::string& text, Strings words = {}) {
        words.insert(words.begin(), "sight");
        words.insert(words.end(), {"--in", folder.write("t.csv", text), "-o", folder.file("out.csv")});
        const std::string line = folder.refusal(words);
        CHECK_THAT(line, Contains("table '" + folder.file("t.csv") + "'"));
        CHECK(folder.files() == 1);  // no output, whole or half
        return line;
    };
    const std::string head = "hs [m],h [m],s [km]\n";
    CHECK_THAT(refused(""),
               Contains("is empty; accepted: a line that names the columns hs [m], h [m], s [m], k (may be left out)"));
    CHECK_THAT(refused("hs [m];h [m];s [km]\n"),
               Contains("line 1: names of columns are separated by ';'; accepted: ','"));
    CHECK_THAT(refused("# hs\nhs [m],Label,s [km]\n1,2,3\n"),
               Contains("line 2: no column is h; found 'hs [m]', 'Label', 's [km]'; accepted: hs [m], h [m]") &&
                   Contains("or h=VALUE behind the model for all rows"));
    CHECK_THAT(
        refused(head + "1,2,3\n1,2,x\n"),
        Contains("line 3, column s is 'x'; it must be a number (km), or one with a unit (m, km, ft, kft, nmi, mi, "
                 "yd) from 0 m to 20003932 m"));
    CHECK_THAT(refused(head + "1,,3\n"), Contains("line 2, column h is empty; it must be"));
    CHECK_THAT(refused(head + "1,nan,3\n"), Contains("column h is 'nan'"));
    CHECK_THAT(refused(head + "1,2,1e999\n"), Contains("column s is '1e999'"));
    CHECK_THAT(refused(head + "1,2,-1\n"), Contains("column s is '-1'"));
    CHECK_THAT(refused(head + "1,2\n"), Contains("line 2 has 2 columns; accepted: 3, as many as are named"));
    CHECK_THAT(refused("hs,h [m],s [km]\n3000,0,3\n"),
               Contains("column hs is '3000'; it must be a number with its unit"));
    CHECK_THAT(refused("hs [deg],h [m],s [km]\n"),
               Contains("column 'hs [deg]'; accepted: units m, km, ft, kft, nmi, mi, yd, as in hs [m]"));
    CHECK_THAT(refused("hs [m,h [m],s [km]\n"), Contains("column 'hs [m'; accepted"));
    CHECK_THAT(refused("hs [m],h [m],s [km],k [m]\n"), Contains("column 'k [m]'; accepted: no unit, as in k"));
    CHECK_THAT(refused("hs [m],h [m],s [km],h [ft]\n"), Contains("column 4 is 'h [ft]', and so is column 2"));
    CHECK_THAT(refused("hs [m],h [m],s [km],r [m]\n"), Contains("column 4 is 'r [m]', which sight writes itself"));
    CHECK_THAT(refused(head, {"h=0"}), Contains("column 2 is 'h [m]', and h is given behind the model too"));
    CHECK_THAT(refused(head + std::string(5000, '1') + "\n"), Contains("line 2 has more than 4096 characters"));
    // A remark on columns is for a table that was done.
    CHECK_THAT(refused("name," + head + "a,1,2,x\n"), Contains("line 2, column s is 'x'"));
}

TEST_CASE("files that cannot be read or may not be written are refused", "[evaluate][quick]") {
    const Folder folder;
    const std::string in = folder.write("t.csv", "h [m]\n100\n");
    CHECK_THAT(folder.refusal({"horizon", "--in", folder.file("none.csv")}, 1),
               Contains("cannot be opened: No such file"));
    CHECK_THAT(folder.refusal({"horizon", "--in", fs::path(in).parent_path().string()}, 1), Contains("is a folder"));
    const std::string out = folder.write("out.csv", "old");
    CHECK_THAT(folder.refusal({"horizon", "--in", in, "-o", out}), Contains("exists"));
    CHECK(content(out) == "old");
    CHECK(folder.run({"horizon", "--in", in, "-o", out, "--overwrite"}).code == 0);
    CHECK(content(out).starts_with("h [m],s_h [m]"));
    CHECK_THAT(folder.refusal({"horizon", "--in", in, "-o", in, "--overwrite"}), Contains(in));
    CHECK(content(in) == "h [m]\n100\n");
    const std::string antenna = folder.write("dish.csv", "0,0\n10,-20\n");
    CHECK_THAT(folder.refusal({"antenna-elevation", "delta=5deg", "antenna=" + antenna, "-o", antenna, "--overwrite"}),
               Contains("antenna") && Contains(antenna));
    CHECK(content(antenna) == "0,0\n10,-20\n");
    const Outcome full = folder.start({"horizon", "--in", in}, "/dev/full");
    CHECK(full.code == 1);
    CHECK_THAT(full.err, Contains("cannot write to standard output"));
}

// ------------------------------------------------------------------------------------------------------- the list

TEST_CASE("each listed model runs in the middle of its ranges, and so does its example", "[evaluate][quick]") {
    const Folder folder;
    const nlohmann::json models = listed();
    REQUIRE(models.size() >= 17);
    std::set<std::string> names, units;
    const std::string page = folder.run({"--list"}).out, help = folder.run({"--help"}).out;
    for (const auto& model : models) {
        const std::string name = model["name"];
        INFO(name);
        CHECK(names.insert(name).second);
        CHECK_THAT(page, Contains("  " + name + " "));
        CHECK_THAT(help, Contains("  " + name + " "));
        const std::string own = folder.run({"--list", name}).out;
        CHECK_THAT(own, Contains(model["summary"].get<std::string>()) && Contains(model["source"].get<std::string>()));
        CHECK_THAT(model["source"].get<std::string>(), Contains("[") && Contains("physics"));
        std::set<std::string> columns;
        std::string header, row;
        for (const auto& input : model["inputs"]) {
            const std::string symbol = input["name"], unit = input["unit"];
            CHECK(columns.insert(symbol).second);
            CHECK_THAT(own, Contains("  " + symbol));
            std::string middle;
            if (input.contains("to")) {
                const double low = input.contains("from") ? input["from"].get<double>() : input["above"].get<double>();
                std::ostringstream number;
                number.precision(17);
                number << (low + input["to"].get<double>()) / 2;
                middle = number.str();
                // Where two ranges of a model do not go together all the way.
                if (symbol == "beta_0") middle = "30";
                if (name == "path-loss" && symbol == "f") middle = "100";
                if (symbol == "h_b") middle = "500";
            } else {
                REQUIRE(!input["words"].empty());
                middle = input["words"][input["words"].size() / 2];
            }
            header += (header.empty() ? "" : ",") + symbol + (unit.empty() ? "" : " [" + unit + "]");
            row += (row.empty() ? "" : ",") + middle;
        }
        const Outcome outcome = folder.run({name, "--in", folder.write(name + ".csv", header + "\n" + row + "\n")});
        INFO(header << "\n" << row << "\n" << outcome.err);
        CHECK(outcome.code == 0);
        CHECK(outcome.err.empty());  // no value lacks
        const auto rows = table(outcome.out);
        REQUIRE(rows.size() == 2);
        REQUIRE(rows[1].size() == model["inputs"].size() + model["outputs"].size());
        for (std::size_t i = 0; i < model["outputs"].size(); ++i) {
            const auto& output = model["outputs"][i];
            const std::string symbol = output["name"], unit = output["unit"];
            CHECK(columns.insert(symbol).second);
            CHECK(rows[0][model["inputs"].size() + i] == symbol + (unit.empty() ? "" : " [" + unit + "]"));
            CHECK(std::isfinite(std::stod(rows[1][model["inputs"].size() + i])));
        }
        CHECK(!values(name, model["example"]).empty());
        // Each end of a range is accepted, as it is printed; what is beyond is not: an input of each unit.
        for (const auto& input : model["inputs"]) {
            const std::string symbol = input["name"], unit = input["unit"];
            if (!input.contains("to") || !units.insert(unit).second) continue;
            const auto refused = [&](double number) {
                std::ostringstream word;
                word.precision(17);
                word << symbol << "=" << number << unit;
                return folder.run({name, word.str(), "--in", folder.file("no such file")}).code == 2;
            };
            const double to = input["to"];
            CHECK(!refused(to));
            CHECK(refused(std::nextafter(to, INFINITY) * (to > 0 ? 1 + 1e-15 : 1) + (to > 0 ? 0 : 1e-9)));
            if (input.contains("from"))
                CHECK(!refused(input["from"]));
            else
                CHECK(refused(input["above"]));
        }
    }
}

// -------------------------------------------------------------------------------------------------------- size

TEST_CASE("two hundred thousand rows pass in a few megabytes", "[evaluate]") {
    const Folder folder;
    const std::string in = folder.file("large.csv"), out = folder.file("out.csv");
    constexpr int rows = 200000;
    {
        std::ofstream file(in);
        file << "label,s [km],hs [ft],h [m]\n";
        for (int i = 0; i < rows; ++i) file << "row" << i << ',' << i % 400 + 0.125 << ",7000," << i % 100 << '\n';
    }
    [[maybe_unused]] const std::uint64_t small = folder.start({"sight", "hs=3km", "h=0", "s=1km"}).peak_rss_bytes;
    const Outcome outcome = folder.start({"sight", "--in", in, "-o", out, "-q"});
    CHECK(outcome.code == 0);
#ifndef __SANITIZE_ADDRESS__                                           // what it holds beside the program is no measure
    CHECK(outcome.peak_rss_bytes < small + (std::uint64_t{8} << 20));  // of 6 MB read and 20 MB written
#endif
    std::ifstream file(out);
    std::string line, last;
    int lines = 0;
    while (std::getline(file, line)) {
        ++lines;
        last = line;
    }
    CHECK(lines == rows + 1);
    CHECK(last.starts_with("row199999,399.125,7000,99,"));
    CHECK(std::stod(split(last, ',')[4]) == value("sight", "s=399.125km hs=7000ft h=99m", "r"));
}
