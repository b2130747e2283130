// accuracy OUT.tsv [--rays N] [--qualities] [--setting SPOKES,BIN,LEAD]... [--uniform] [SCENE...]: error against time.
// Runs scenes of the shipped data at every quality and at raw settings of the sampling, compares power and states with
// the independent reference of tests/reference (converged to 0.01 dB with 48 rays a bin of 3/8 degree), and writes a row
// for each: what it cost and how far off it was. Beside them, by the reference's own code, polar sampling (rays with
// even, coarse steps) and, with --uniform, for that takes longest, an even grid over the ground.
//
//   rms, p99   dB, of the power image over cells above the noise in either, noise added to both (design of the promises)
//   near, middle, far   RMS in the nearest, middle and farthest third of the ranges
//   grey       RMS of the grey levels of the default receiver
//   states     per cent of cells whose states differ
//   shift      bins by which the image lies off, in range or azimuth, whichever is more: where its correlation peaks
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "lib/engine.hpp"
#include "lib/error.hpp"
#include "lib/receiver.hpp"
#include "lib/target.hpp"
#include "tests/reference/reference_engine.hpp"
#include "tiles/gdal_session.hpp"
#include "tiles/sources.hpp"
#include "tools/report_json.hpp"

using namespace wedgescope;

namespace {

const std::string data = WEDGESCOPE_TEST_DATA;

enum Cover { bare, classes, culture };  // culture: classes and canopy

struct Place {
    const char* name;
    const char* stem;  // of the shipped files; or one of them
    Cover cover;
    double lat, lon, altitude_m;
    int first_deg;  // of 90 degrees
    double range_m, post_m;
    AltitudeAbove above = AltitudeAbove::sea_level;
    double beam_deg = 1.5, pulse_us = 0.5, power_w = 50e3;

    int circle() const { return static_cast<int>(4 * 360 / beam_deg); }  // four azimuth bins a beam
    int bins() const { return circle() / 4; }
    int first_bin() const { return first_deg * circle() / 360; }
};
constexpr AltitudeAbove low = AltitudeAbove::ground;
const Place places[] = {
    {"inland_empire 2134 m, culture", "inland_empire", culture, 33.93, -117.33, 2134, 180, 30000, 30},
    {"inland_empire 2134 m, bare", "inland_empire", bare, 33.93, -117.33, 2134, 180, 30000, 30},
    {"inland_empire 838 m, culture", "inland_empire", culture, 33.93, -117.33, 838, 180, 30000, 30},
    {"inland_empire 838 m, bare", "inland_empire", bare, 33.93, -117.33, 838, 180, 30000, 30},
    {"worcester 1400 m, culture", "worcester_vermont", culture, 44.42, -72.56, 1400, 0, 11000, 30},
    {"olympic_coast 1500 m", "olympic_coast", bare, 48.2, -124.6, 1500, 90, 30000, 30},
    {"olympic_coast 12000 m", "olympic_coast", bare, 48.2, -124.6, 12000, 90, 40000, 30},
    {"azores 3000 m", "azores", bare, 38.5, -28.3, 3000, 90, 60000, 92},
    {"inland_empire 400 m above ground, culture", "inland_empire", culture, 33.93, -117.33, 400, 180, 20000, 30, low},
    {"inland_empire 150 m above ground, bare", "inland_empire", bare, 33.93, -117.33, 150, 180, 20000, 30, low},
    {"worcester 50 m above ground, bare", "worcester_vermont", bare, 44.42, -72.56, 50, 0, 11000, 30, low},
    {"olympic_coast 400 m above ground", "olympic_coast", bare, 48.2, -124.6, 400, 90, 20000, 30, low},
    {"white_mountains 2500 m", "N44W072.hgt", bare, 44.27, -71.3, 2500, 225, 46300, 92, AltitudeAbove::sea_level, 1.5,
     1.3},
    {"white_mountains 2500 m, 3 deg", "N44W072.hgt", bare, 44.27, -71.3, 2500, 225, 60000, 92, AltitudeAbove::sea_level,
     3, 2.6},
    {"beam 0.75 deg, pulse 0.25 us", "inland_empire", bare, 33.93, -117.33, 838, 180, 30000, 30,
     AltitudeAbove::sea_level, 0.75, 0.25},
    {"beam 3 deg, pulse 1 us", "inland_empire", bare, 33.93, -117.33, 838, 180, 30000, 30, AltitudeAbove::sea_level, 3,
     1},
    {"beam 6 deg, 838 m, culture", "inland_empire", culture, 33.93, -117.33, 838, 180, 30000, 30,
     AltitudeAbove::sea_level, 6, 2},
    {"beam 6 deg, 400 m above ground, culture", "inland_empire", culture, 33.93, -117.33, 400, 180, 25000, 30, low, 6,
     1},
    {"beam 6 deg, 150 m above ground, bare", "inland_empire", bare, 33.93, -117.33, 150, 180, 25000, 30, low, 6, 1},
    {"beam 6 deg, olympic_coast 1500 m", "olympic_coast", bare, 48.2, -124.6, 1500, 90, 30000, 30,
     AltitudeAbove::sea_level, 6, 1},
    {"beam 6 deg, 30 m above ground, bare", "inland_empire", bare, 33.93, -117.33, 30, 180, 20000, 30, low, 6, 1},
    {"beam 6 deg, 60 m above ground, culture", "inland_empire", culture, 33.93, -117.33, 60, 180, 20000, 30, low, 6, 1},
    {"beam 6 deg, pulse 2 us", "inland_empire", bare, 33.93, -117.33, 838, 180, 30000, 30, AltitudeAbove::sea_level, 6,
     2},
    // So high that fewer spokes do, the weaker the radar.
    {"beam 6 deg, 1300 m above ground, bare", "inland_empire", bare, 33.93, -117.33, 1300, 180, 35000, 30, low, 6, 1},
    {"the same, 2 kW", "inland_empire", bare, 33.93, -117.33, 1300, 180, 35000, 30, low, 6, 1, 2e3},
    {"the same, 200 W", "inland_empire", bare, 33.93, -117.33, 1300, 180, 35000, 30, low, 6, 1, 200},
    {"beam 6 deg, 1300 m above ground, culture, 200 W", "inland_empire", culture, 33.93, -117.33, 1300, 180, 35000, 30,
     low, 6, 1, 200},
    {"beam 6 deg, olympic_coast 1300 m above ground, 2 kW", "olympic_coast", bare, 48.2, -124.6, 1300, 90, 45000, 30,
     low, 6, 1, 2e3},
    {"beam 12 deg, 2500 m above ground, bare, 1 kW", "inland_empire", bare, 33.93, -117.33, 2500, 180, 35000, 30, low,
     12, 1, 1e3},
    {"beam 1.5 deg, 2500 m above ground, bare, 5 kW", "inland_empire", bare, 33.93, -117.33, 2500, 180, 35000, 30, low,
     1.5, 1, 5e3},
    {"beam 12 deg, 8000 m above ground, bare, 1 kW", "inland_empire", bare, 33.93, -117.33, 8000, 180, 35000, 30, low,
     12, 1, 1e3},
    {"beam 6 deg, 4000 m above ground, bare", "inland_empire", bare, 33.93, -117.33, 4000, 180, 35000, 30, low, 6, 1},
    {"beam 6 deg, 4000 m above ground, culture", "inland_empire", culture, 33.93, -117.33, 4000, 180, 35000, 30, low, 6,
     1},
    {"beam 12 deg, 8000 m above ground, bare", "inland_empire", bare, 33.93, -117.33, 8000, 180, 35000, 30, low, 12, 1},
    {"beam 12 deg, 8000 m above ground, culture", "inland_empire", culture, 33.93, -117.33, 8000, 180, 35000, 30, low,
     12, 1},
    {"beam 6 deg, olympic_coast 8000 m above ground", "olympic_coast", bare, 48.2, -124.6, 8000, 90, 45000, 30, low, 6,
     1},
    // Over a valley, towards mountains as high as the sensor; and other quadrants of the first place.
    {"33.8,-117.5 to the west, 1300 m above ground", "inland_empire", bare, 33.8, -117.5, 1300, 180, 20000, 30, low},
    {"33.8,-117.5 to the west, 1300 m, classes", "inland_empire", classes, 33.8, -117.5, 1300, 180, 20000, 30, low},
    {"33.8,-117.5 to the west, beam 6 deg, 1300 m", "inland_empire", bare, 33.8, -117.5, 1300, 180, 20000, 30, low, 6},
    {"33.8,-117.5 to the east, beam 6 deg, 200 m", "inland_empire", bare, 33.8, -117.5, 200, 0, 20000, 30, low, 6},
    {"33.93,-117.33 to the east, 600 m above ground", "inland_empire", bare, 33.93, -117.33, 600, 0, 20000, 30, low},
    {"33.93,-117.33 to the east, beam 6 deg, 1300 m", "inland_empire", bare, 33.93, -117.33, 1300, 0, 20000, 30, low,
     6},
    {"worcester 300 m above ground, to the west", "worcester_vermont", bare, 44.42, -72.56, 300, 180, 11000, 30, low,
     3},
    // Classes side by side on bare ground: their borders are all there is between posts.
    {"inland_empire 2134 m, classes", "inland_empire", classes, 33.93, -117.33, 2134, 180, 30000, 30},
    {"inland_empire 838 m, classes", "inland_empire", classes, 33.93, -117.33, 838, 180, 30000, 30},
    {"worcester 1400 m, classes", "worcester_vermont", classes, 44.42, -72.56, 1400, 0, 11000, 30},
    {"inland_empire 150 m above ground, classes", "inland_empire", classes, 33.93, -117.33, 150, 180, 20000, 30, low},
    {"beam 6 deg, 60 m above ground, classes", "inland_empire", classes, 33.93, -117.33, 60, 180, 20000, 30, low, 6, 1},
    {"beam 6 deg, 838 m, classes", "inland_empire", classes, 33.93, -117.33, 838, 180, 30000, 30,
     AltitudeAbove::sea_level, 6, 2},
    {"beam 1.5 deg, 1300 m above ground, classes", "inland_empire", classes, 33.93, -117.33, 1300, 180, 35000, 30, low},
    {"inland_empire 700 m above ground, classes", "inland_empire", classes, 33.93, -117.33, 700, 180, 30000, 30, low},
    {"beam 6 deg, 1300 m above ground, classes", "inland_empire", classes, 33.93, -117.33, 1300, 180, 35000, 30, low, 6,
     1},
    {"beam 12 deg, 8000 m above ground, classes", "inland_empire", classes, 33.93, -117.33, 8000, 180, 35000, 30, low,
     12, 1},
};

DataBaseParams layers(const Place& p) {
    DataBaseParams db;
    const std::string stem = data + "/" + p.stem;
    db.dem = stem.ends_with(".hgt") ? stem : stem + "_dem.tif";
    if (p.cover != bare) {
        db.culture = data + "/" + p.stem + "_culture.tif";
        db.legend = Legend::built_in("fbfm40");
    }
    if (p.cover == culture) {
        db.culture_height = data + "/" + p.stem + "_canopy.tif";
        db.culture_height_scale = 0.1;
    }
    return db;
}

Scene scene_of(const Place& p) {
    Scene s;
    s.platform.latlon = LatLon{p.lat, p.lon};
    s.platform.altitude_above = p.above;
    s.platform.altitude_m = p.altitude_m;
    s.azimuth_bins = p.circle();
    s.radar.antenna.beam = Angle::degrees(p.beam_deg);
    s.radar.pulse_s = p.pulse_us * 1e-6;
    s.radar.transmit_power_w = p.power_w;
    s.range_m = p.range_m;
    s.range_start_m = 2 * p.post_m / s.radar.antenna.beam.rad();  // from where the beam is two posts wide
    s.sector = Sector{Angle::degrees(p.first_deg), Angle::degrees(p.first_deg + 90)};
    s.display.size = 512;
    return s;
}

reference::Scene reference_of(const Place& p, const DataBaseParams& db, double sensor_m, const RunResult& like) {
    reference::Scene r;
    r.dem = db.dem;
    r.culture = db.culture;
    r.culture_height = db.culture_height;
    r.culture_height_scale = db.culture_height_scale;
    r.class_of_code = reference::fbfm40_classes();
    r.gamma = reference::project_gamma();
    r.lat_deg = p.lat;
    r.lon_deg = p.lon;
    r.height_msl_m = sensor_m;
    r.azimuth_bins = p.circle();
    r.beamwidth_deg = p.beam_deg;
    r.pulse_s = p.pulse_us * 1e-6;
    r.transmit_power_w = p.power_w;
    r.first_azimuth_bin = p.first_bin();
    r.azimuth_count = p.bins();
    r.range_bin_m = like.power_w.grid.range_bin_m;
    r.range_bins = static_cast<int>(like.power_w.grid.range_bins.end);
    return r;
}

struct Images {
    std::vector<double> power_w;
    std::vector<std::uint8_t> state;
};

/// Without the bins in front of the first one shown.
Images cut(const reference::Result& whole, std::size_t skip) {
    Images out;
    const auto all = static_cast<std::size_t>(whole.range_bins);
    for (std::size_t i = 0; i < whole.power_w.size(); ++i) {
        if (i % all < skip) continue;
        out.power_w.push_back(whole.power_w[i]);
        out.state.push_back(whole.state[i]);
    }
    return out;
}

struct Errors {
    reference::Comparison all;
    double bands_db[3] = {};
    double states = 0;
    double grey = 0;
    double shift = 0;
};

/// Sum of products of two images' dB (noise added, mean taken off), the one moved by so many rows and columns.
double correlation(const std::vector<double>& a, const std::vector<double>& b, std::size_t columns, std::int64_t row,
                   std::int64_t column) {
    const auto width = static_cast<std::int64_t>(columns), height = static_cast<std::int64_t>(a.size()) / width;
    double sum = 0;
    for (std::int64_t y = 1; y < height - 1; ++y)
        for (std::int64_t x = 1; x < width - 1; ++x)
            sum += a[static_cast<std::size_t>((y + row) * width + x + column)] *
                   b[static_cast<std::size_t>(y * width + x)];
    return sum;
}
/// Bins by which image a lies off from b, along rows or columns: the top of the parabola through their correlation.
double shift_of(const std::vector<double>& a, const std::vector<double>& b, std::size_t columns) {
    const auto top = [&](const std::vector<double>& of, std::int64_t row, std::int64_t column) {
        const double before = correlation(of, b, columns, -row, -column), at = correlation(of, b, columns, 0, 0),
                     after = correlation(of, b, columns, row, column);
        return 0.5 * (after - before) / (2 * at - before - after);
    };
    return std::max(std::abs(top(a, 1, 0) - top(b, 1, 0)), std::abs(top(a, 0, 1) - top(b, 0, 1)));
}
std::vector<double> levelled_db(const std::vector<double>& power_w, double noise_w) {
    std::vector<double> db;
    double mean = 0;
    for (const double w : power_w) {
        db.push_back(10 * std::log10(w + noise_w));
        mean += db.back() / static_cast<double>(power_w.size());
    }
    for (double& v : db) v -= mean;
    return db;
}

Errors compare(const Images& test, const Images& truth, std::size_t columns, double noise_w, const Receiver& receiver) {
    Errors e;
    double squares = 0;
    for (std::size_t i = 0; i < truth.power_w.size(); ++i) {  // without STC a grey level is the same at every range
        const double off = static_cast<double>(receiver.grey(test.power_w[i] + noise_w, 0)) -
                           static_cast<double>(receiver.grey(truth.power_w[i] + noise_w, 0));
        squares += off * off;
    }
    e.grey = std::sqrt(squares / static_cast<double>(truth.power_w.size()));
    e.shift = shift_of(levelled_db(test.power_w, noise_w), levelled_db(truth.power_w, noise_w), columns);
    e.all = reference::compare(test.power_w, truth.power_w, noise_w);
    e.states = reference::state_difference(test.state, truth.state);
    for (std::size_t band = 0; band < 3; ++band) {
        const std::size_t begin = band * columns / 3, end = (band + 1) * columns / 3;
        const auto part = [&](const std::vector<double>& image) {
            std::vector<double> out;
            for (std::size_t row = 0; row < image.size() / columns; ++row)
                out.insert(out.end(), image.begin() + static_cast<std::ptrdiff_t>(row * columns + begin),
                           image.begin() + static_cast<std::ptrdiff_t>(row * columns + end));
            return out;
        };
        e.bands_db[band] = reference::compare(part(test.power_w), part(truth.power_w), noise_w).rms_db;
    }
    return e;
}

class Table {
public:
    explicit Table(const char* path) : file_(std::fopen(path, "w"), std::fclose) {
        if (!file_) throw IoError(text("'", path, "' cannot be written"));
        fmt::print(
            file_.get(),
            "scene\tsetting\tcpu_s\twall_s\tsamples\tbytes_read\trms_db\tp99_db\tnear_db\tmiddle_db\tfar_db\tgrey\t"
            "states\tshift\n");
    }
    void row(const char* scene, const std::string& setting, double cpu_s, double wall_s, std::uint64_t samples,
             std::uint64_t bytes, const Errors& e) {
        fmt::print(file_.get(),
                   "{}\t{}\t{:.3f}\t{:.3f}\t{}\t{}\t{:.4f}\t{:.4f}\t{:.4f}\t{:.4f}\t{:.4f}\t{:.3f}\t{:.4f}\t{:.5f}\n",
                   scene, setting, cpu_s, wall_s, samples, bytes, e.all.rms_db, e.all.p99_db, e.bands_db[0],
                   e.bands_db[1], e.bands_db[2], e.grey, 100 * e.states, e.shift);
        std::fflush(file_.get());
        fmt::print("{:<42} {:<38} {:>7.3f} s  rms {:.4f}  p99 {:.4f}  grey {:.2f}  states {:.3f} %  shift {:.4f}\n",
                   scene, setting, cpu_s, e.all.rms_db, e.all.p99_db, e.grey, 100 * e.states, e.shift);
        std::fflush(stdout);
    }

private:
    std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
};

struct Setting {
    std::string name;
    Quality quality = Quality::exact;
    std::optional<double> spokes, per_bin, lead;
    std::optional<bool> crossings, curved;
};
Setting raw(double spokes, double per_bin, double lead) {
    return {fmt::format("{} a post, {} a bin, lead {}", spokes, per_bin, lead),
            Quality::exact,
            spokes,
            per_bin,
            lead,
            true,
            true};
}
std::vector<Setting> qualities() {
    std::vector<Setting> all;
    for (const Quality q : {Quality::draft, Quality::normal, Quality::fine, Quality::exact})
        all.push_back({text("quality ", word(q)), q, {}, {}, {}, {}, {}});
    return all;
}
std::vector<Setting> settings() {
    std::vector<Setting> all = qualities();
    for (const double per_bin : {2, 4, 8, 16, 32})
        for (const double spokes : {0.5, 1.0, 2.0}) all.push_back(raw(spokes, per_bin, 4));
    for (const double lead : {1, 2, 8})
        for (const double spokes : {0.5, 1.0, 2.0, 4.0}) all.push_back(raw(spokes, 8, lead));
    for (const double spokes : {0.5, 1.0, 2.0, 4.0})
        all.push_back({fmt::format("{} a post, 16 a bin, lines of one axis", spokes), Quality::exact, spokes, 16, 4,
                       false, false});
    return all;
}

void measure(const Place& place, int rays_per_bin, const std::vector<Setting>& wanted, bool polar, bool uniform,
             Table& table) {
    const DataBaseParams db = layers(place);
    const double noise_w = reference::noise_w(scene_of(place).radar.noise_bandwidth_hz(), 8);
    const Receiver receiver(scene_of(place).receiver, scene_of(place).radar);
    Images truth;
    std::size_t skip = 0, columns = 0;
    reference::Scene r;
    for (const Setting& setting : wanted) {
        Scene s = scene_of(place);
        s.quality = setting.quality;
        s.spokes_per_post = setting.spokes;
        s.spokes_per_bin = setting.per_bin;
        s.spoke_lead = setting.lead;
        s.crossings = setting.crossings;
        s.curved_course = setting.curved;
        const auto source = open_direct_source(db);
        EngineParams params;
        params.threads = 1;
        const double start = now_s();
        const ResolvedScene resolved = resolve(s, *source);
        const RunResult ours = run(resolved, *source, params);
        const double wall_s = now_s() - start;
        if (truth.power_w.empty()) {
            r = reference_of(place, db, resolved.sensor_m, ours);
            r.rays_per_bin = static_cast<int>(rays_per_bin * std::max(1.0, place.beam_deg / 1.5));
            skip = static_cast<std::size_t>(ours.power_w.grid.range_bins.begin);
            columns = static_cast<std::size_t>(ours.power_w.grid.range_bins.size());
            truth = cut(reference::simulate(r), skip);
        }
        double cpu_s = 0;
        std::uint64_t samples = 0, bytes = 0;
        for (const WedgeReport& w : ours.report.wedges) {
            for (const CpuStage& stage : cpu_stages) cpu_s += w.*stage.seconds;
            samples += w.samples;
            bytes += w.bytes_read;
        }
        const Images test{{ours.power_w.cells.begin(), ours.power_w.cells.end()},
                          {ours.state.cells.begin(), ours.state.cells.end()}};
        table.row(place.name, setting.name, cpu_s, wall_s, samples, bytes,
                  compare(test, truth, columns, noise_w, receiver));
    }
    for (const int rays : polar ? std::vector{2, 4, 8, 16} : std::vector<int>()) {
        reference::Scene even = r;
        even.rays_per_bin = rays;
        even.step_posts = 4.0 / rays;
        even.split_steps = false;
        const reference::Result made = reference::simulate(even);
        const double steps = r.range_bins * r.range_bin_m / (made.post_m * even.step_posts);
        table.row(place.name, fmt::format("polar, {} rays a bin, steps of {:.3g} posts", rays, even.step_posts),
                  made.cpu_s, made.cpu_s, static_cast<std::uint64_t>(steps * rays * place.bins()), 0,
                  compare(cut(made, skip), truth, columns, noise_w, receiver));
    }
    for (const int samples : uniform ? std::vector{1, 2} : std::vector<int>()) {
        reference::Scene even = r;
        even.uniform_posts = 1.0 / samples;
        const reference::Result made = reference::simulate(even);
        const double samples_long = r.range_bins * r.range_bin_m * samples / made.post_m;
        const double turn = static_cast<double>(place.bins()) / place.circle();
        table.row(place.name, fmt::format("uniform, a sample each {}post", samples == 1 ? "" : "1/2 "), made.cpu_s,
                  made.cpu_s, static_cast<std::uint64_t>(turn * std::numbers::pi * samples_long * samples_long), 0,
                  compare(cut(made, skip), truth, columns, noise_w, receiver));
    }
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 2 || argv[1][0] == '-') {
        fmt::print(
            stderr,
            "usage: accuracy OUT.tsv [--rays N] [--qualities] [--setting SPOKES,BIN,LEAD]... [--uniform] [SCENE...]\n"
            "  --rays N       of the reference in 3/8 of a degree, 48 without\n"
            "  --qualities    no raw settings but those given after it, and no polar sampling\n"
            "  --setting ...  a raw setting more: spokes a post, spokes a bin, lead\n"
            "  --uniform      uniform sampling too, which takes longest\n"
            "  SCENE          scenes whose names begin so; all without\n");
        return 2;
    }
    int rays = 48, scenes = 2;
    std::vector<Setting> wanted = settings();
    bool polar = true, uniform = false;
    for (; scenes < argc; ++scenes) {
        double spokes = 0, per_bin = 0, lead = 0;
        if (std::strcmp(argv[scenes], "--rays") == 0 && scenes + 1 < argc) {
            rays = std::atoi(argv[++scenes]);
        } else if (std::strcmp(argv[scenes], "--qualities") == 0) {
            wanted = qualities();
            polar = false;
        } else if (std::strcmp(argv[scenes], "--uniform") == 0) {
            uniform = true;
        } else if (std::strcmp(argv[scenes], "--setting") == 0 && scenes + 1 < argc &&
                   std::sscanf(argv[scenes + 1], "%lf,%lf,%lf", &spokes, &per_bin, &lead) == 3) {
            wanted.push_back(raw(spokes, per_bin, lead));
            ++scenes;
        } else {
            break;
        }
    }
    const auto begins_with = [](const Place& place, const char* name) {
        return std::strncmp(place.name, name, std::strlen(name)) == 0;
    };
    for (int i = scenes; i < argc; ++i)
        if (std::none_of(std::begin(places), std::end(places),
                         [&](const Place& place) { return begins_with(place, argv[i]); })) {
            fmt::print(stderr, "accuracy: '{}' is neither an option nor how a scene's name begins; scenes:\n", argv[i]);
            for (const Place& place : places) fmt::print(stderr, "  {}\n", place.name);
            return 2;
        }
    try {
        use_target_of_environment();
        const GdalSession session(64 << 20, {});
        Table table(argv[1]);
        for (const Place& place : places) {
            const bool chosen = argc <= scenes || std::any_of(argv + scenes, argv + argc, [&](const char* name) {
                                    return begins_with(place, name);
                                });
            if (chosen) measure(place, rays, wanted, polar, uniform, table);
        }
    } catch (const std::exception& e) {
        fmt::print(stderr, "accuracy: {}\n", e.what());
        return 1;
    }
}
