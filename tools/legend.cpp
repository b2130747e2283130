#include "tools/legend.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "lib/error.hpp"
#include "lib/length.hpp"
#include "lib/receiver.hpp"
#include "tiles/claim.hpp"
#include "tools/terminal.hpp"

extern char** environ;

namespace wedgescope {
namespace {

constexpr const char* helper_name = "wedgescope_picture";

std::pair<Descriptor, Descriptor> make_pipe() {
    int ends[2];
    if (::pipe2(ends, O_CLOEXEC) != 0)
        throw IoError(text("cannot make a pipe to ", helper_name, ": ", system_reason(errno)));
    return {Descriptor(ends[0]), Descriptor(ends[1])};
}

/// A write of this thread to a pipe that nobody reads fails, and signals nothing: the helper's end is not that of the run. Of
/// this thread alone, for frames of a track are drawn side by side.
class NoPipeSignal {
public:
    NoPipeSignal() {
        ::sigemptyset(&pipe_);
        ::sigaddset(&pipe_, SIGPIPE);
        sigset_t waiting;
        ::sigpending(&waiting);
        of_others_ = ::sigismember(&waiting, SIGPIPE) == 1;
        ::pthread_sigmask(SIG_BLOCK, &pipe_, &before_);
    }
    ~NoPipeSignal() {
        constexpr timespec at_once{};
        while (!of_others_ && ::sigtimedwait(&pipe_, nullptr, &at_once) < 0 && errno == EINTR) {
        }
        ::pthread_sigmask(SIG_SETMASK, &before_, nullptr);
    }
    NoPipeSignal(const NoPipeSignal&) = delete;
    NoPipeSignal& operator=(const NoPipeSignal&) = delete;

private:
    sigset_t pipe_{}, before_{};
    bool of_others_ = false;  ///< one waits already: it stays
};

/// Runs the helper with `input` on its stdin; what it writes to stdout.
std::string answer_of(const std::string& helper, const std::string& input) {
    auto [input_read, input_write] = make_pipe();
    auto [output_read, output_write] = make_pipe();
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, input_read.get(), STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&actions, output_write.get(), STDOUT_FILENO);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);  // its reasons come on stdout
    std::string program = helper, verb = "legend";
    char* arguments[] = {program.data(), verb.data(), nullptr};
    pid_t child = 0;
    const int failed = ::posix_spawn(&child, helper.c_str(), &actions, nullptr, arguments, environ);
    posix_spawn_file_actions_destroy(&actions);
    if (failed) throw IoError(text("cannot start ", in_quotes(helper), " for the legend: ", system_reason(failed)));
    input_read = Descriptor();
    output_write = Descriptor();

    // The helper reads all its input before it writes.
    {
        const NoPipeSignal here;
        for (std::size_t done = 0; done < input.size();) {
            const ssize_t n = ::write(input_write.get(), input.data() + done, input.size() - done);
            if (n < 0 && errno == EINTR) continue;
            if (n <= 0) break;
            done += static_cast<std::size_t>(n);
        }
    }
    input_write = Descriptor();
    std::string answer;
    for (char block[65536];;) {
        const ssize_t n = ::read(output_read.get(), block, sizeof block);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) break;
        answer.append(block, static_cast<std::size_t>(n));
    }
    int status = 0;
    while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
        const std::string how =
            WIFEXITED(status) ? text(" with exit code ", WEXITSTATUS(status)) : text(" by signal ", WTERMSIG(status));
        throw IoError(text("legend: ", in_quotes(helper), " failed", how,
                           answer.empty() || answer.starts_with("P5") ? "" : ": " + answer.substr(0, 300)));
    }
    return answer;
}

struct Panel {
    std::int64_t width = 0, height = 0;
    std::string_view grey;
};

/// A binary PGM: P5, width, height, 255, one white space, bytes.
Panel read_panel(const std::string& helper, const std::string& pgm) {
    const auto refuse = [&] { return IoError(text("legend: ", in_quotes(helper), " gave no picture back")); };
    if (!pgm.starts_with("P5\n")) throw refuse();
    const char* at = pgm.data() + 3;
    const char* const end = pgm.data() + pgm.size();
    std::int64_t numbers[3] = {};
    for (std::int64_t& number : numbers) {
        const auto [next, error] = std::from_chars(at, end, number);
        if (error != std::errc{} || next == end || number < 1 || number > 100000) throw refuse();
        at = next + 1;
    }
    if (end - at != numbers[0] * numbers[1]) throw refuse();
    return {numbers[0], numbers[1], {at, static_cast<std::size_t>(end - at)}};
}

std::string trimmed_number(double value, int digits) {
    std::string out = fmt::format("{:.{}f}", value, digits);
    if (out.find('.') != std::string::npos) {
        while (out.back() == '0') out.pop_back();
        if (out.back() == '.') out.pop_back();
    }
    return out == "-0" ? "0" : out;
}

/// To four digits, as steps and ranges that are round numbers of another unit need them.
std::string in_nautical_miles(double metres) {
    const double miles = metres / nautical_mile_m;
    return trimmed_number(miles, miles < 10 ? 3 : miles < 100 ? 2 : 1);
}
std::string nautical_miles(double metres) { return in_nautical_miles(metres) + " nmi"; }

/// As the panel can write it: what draws it knows no letters but those of ASCII, and a name may be longer than a line.
std::string legible(const std::string& name) {
    constexpr std::size_t longest = 44;
    std::string out;
    for (const char c : name) {
        const auto byte = static_cast<unsigned char>(c);
        if (byte < 0x80)
            out += c;
        else if (byte >= 0xc0)  // the first byte of a character
            out += '?';
    }
    return out.size() > longest ? out.substr(0, longest - 3) + "..." : out;
}

std::string degrees(Angle angle) { return trimmed_number(angle.deg(), 2) + " deg"; }

std::string position(double value, char positive, char negative) {
    return fmt::format("{:.4f} {}", std::abs(value), value < 0 ? negative : positive);
}

std::string display_name(DisplayKind kind) {
    switch (kind) {
        case DisplayKind::gpi:
            return "GPI";
        case DisplayKind::gpi_true:
            return "GPI (true)";
        case DisplayKind::ppi:
            return "PPI";
        case DisplayKind::tdppi:
            return "Time-delayed PPI";
    }
    return "";
}

/// ASCII only but for file names: OpenImageIO 2.4 draws other letters wrong.
nlohmann::ordered_json legend_text(const Settings& settings, const ResolvedScene& r, const Picture& picture) {
    using json = nlohmann::ordered_json;
    const Scene& s = r.scene;
    const RadarParams& radar = s.radar;
    const ReceiverParams& receiver = s.receiver;
    json sections = json::array();
    const auto section = [&](const char* title) {
        sections.push_back(json{{"title", title}, {"lines", json::array()}});
    };
    const auto line = [&](const std::string& label, const std::string& value) {
        sections.back()["lines"].push_back(json::array({label, value}));
    };

    section("SENSOR");
    if (r.has_lat_lon) {
        line("Latitude", position(r.lat_deg, 'N', 'S'));
        line("Longitude", position(std::remainder(r.lon_deg, 360.0), 'E', 'W'));
    } else {
        line("x", trimmed_number(r.x, 1));
        line("y", trimmed_number(r.y, 1));
    }
    line("Altitude MSL", fmt::format("{:.0f} m  {:.0f} ft", r.sensor_m, r.sensor_m / foot_m));
    if (r.nadir_on_data)
        line("Above ground",
             fmt::format("{:.0f} m  {:.0f} ft", r.sensor_m - r.reference_m, (r.sensor_m - r.reference_m) / foot_m));
    line("Heading", degrees(s.platform.heading));
    line("Sector", s.sector ? trimmed_number(s.sector->from.deg(), 2) + " to " + degrees(s.sector->to) : "full circle");

    section("SCOPE");
    line(s.display.kind == DisplayKind::gpi_true ? "Ground range" : "Slant range",
         nautical_miles(s.range_m.value_or(0)));
    if (s.range_start_m > 0) line("From", nautical_miles(s.range_start_m));
    const bool delayed = s.display.kind == DisplayKind::tdppi;
    if (delayed) line("Sweep delay", nautical_miles(r.sweep_delay_m));
    if (!picture.ring_range_m.empty()) {
        const double step = picture.ring_range_m.size() > 1 ? picture.ring_range_m[1] - picture.ring_range_m[0]
                                                            : picture.ring_range_m[0];
        line("Range rings", "every " + nautical_miles(step) + (delayed ? " past delay" : ""));
        std::string values;
        for (const double ring : picture.ring_range_m) values += (values.empty() ? "" : "  ") + in_nautical_miles(ring);
        constexpr std::size_t fit_a_line = 9;
        if (picture.ring_range_m.size() <= fit_a_line) line("", values);
    }
    if (s.display.azimuth_marks_rad)
        line("Azimuth marks", "every " + degrees(Angle::radians(*s.display.azimuth_marks_rad)) + " from heading");
    line("Up", s.display.orientation == Orientation::north ? "north" : "heading");
    line("Pixel", trimmed_number(picture.frame.metres_per_pixel, 1) + " m");

    section("RADAR");
    line("Frequency", trimmed_number(radar.frequency_hz * 1e-9, 3) + " GHz");
    line("Peak power", radar.transmit_power_w >= 1e3 ? trimmed_number(radar.transmit_power_w * 1e-3, 2) + " kW"
                                                     : trimmed_number(radar.transmit_power_w, 3) + " W");
    line("Antenna gain", trimmed_number(radar.gain.db(), 1) + " dB");
    const auto drawn = [](bool on, double scale) {
        return on && scale != 1 ? "  drawn x " + trimmed_number(scale, 2) : std::string();
    };
    line("Pulse", trimmed_number(radar.pulse_s * 1e6, 3) + " us  " + trimmed_number(radar.pulse_extent_m(), 0) + " m" +
                      drawn(radar.pulse_length_error, radar.pulse_length_scale));
    line("Beam", degrees(radar.antenna.beam) + drawn(radar.beam_width_error, radar.beam_width_scale));
    line("Elevation", std::string(word(radar.antenna.elevation)) + "  tilt " + degrees(radar.antenna.tilt));

    const WeatherParams& weather = s.weather;
    if (weather.rain_mm_h > 0 || weather.vapour_g_m3 || weather.liquid_water_g_m3 > 0 || s.sea_state > 0) {
        section("WEATHER");
        if (weather.rain_mm_h > 0)
            line("Rain",
                 text(trimmed_number(weather.rain_mm_h, 2), " mm/h  to ", trimmed_number(weather.rain_top_m, 0), " m"));
        if (weather.vapour_g_m3) line("Gases", trimmed_number(*weather.vapour_g_m3, 2) + " g/m3");
        if (weather.liquid_water_g_m3 > 0)
            line("Cloud",
                 text(trimmed_number(weather.liquid_water_g_m3, 3), " g/m3  ", trimmed_number(weather.cloud_base_m, 0),
                      " to ", trimmed_number(weather.cloud_top_m, 0), " m"));
        if (s.sea_state > 0) line("Sea state", trimmed_number(s.sea_state, 1));
    }

    section("RECEIVER");
    line("IF gain", trimmed_number(receiver.if_gain.db(), 1) + " dB");
    line("Video gain", trimmed_number(receiver.video_gain.db(), 1) + " dB");
    if (receiver.stc_range_m)
        line("STC", nautical_miles(*receiver.stc_range_m) + "  n " + trimmed_number(receiver.stc_exponent, 1) +
                        "  max " + trimmed_number(receiver.stc_max.db(), 0) + " dB");
    const double mds = Receiver(receiver, radar).mds_dbm();
    line("MDS", trimmed_number(mds, 1) + " dBm");
    if (receiver.speckle_looks > 0)
        line("Speckle", text(receiver.speckle_looks, receiver.speckle_looks == 1 ? " look" : " looks"));
    if (receiver.noise) line("Noise", "fluctuating");

    section("DATA BASE");
    const auto name = [](const std::string& path) {
        const std::filesystem::path whole(path);
        // A folder may be given with a slash behind it.
        return legible((whole.has_filename() ? whole : whole.parent_path()).filename().string());
    };
    line("Terrain", name(settings.dem));
    if (!settings.culture.empty()) line("Culture", name(settings.culture));
    if (!settings.culture_height.empty()) line("Heights", name(settings.culture_height));

    // What received power is black and white (physics 2.4): v_if = (P - MDS + G_if - 64) / D, at most 1, times the video gain.
    // Where that is less than 1, nothing is white: the limiter's grey is the brightest.
    const double black_dbm = mds + if_gain_reference.db() - receiver.if_gain.db(),
                 gain_db = receiver.video_gain.db() - video_gain_reference.db();
    const double brightest_dbm = black_dbm + receiver.dynamic_range.db() / std::pow(10.0, std::max(0.0, gain_db) / 20);
    const int brightest = receiver_levels(receiver, mds, brightest_dbm + 1, 0).grey;
    json out;
    out["width"] = picture.frame.width;
    out["height"] = picture.frame.height;
    out["title"] = display_name(s.display.kind);
    out["subtitle"] = text("wedgescope ", version());
    out["sections"] = sections;
    out["scale"] = json{{"title", receiver.stc_range_m ? "RECEIVED POWER less STC" : "RECEIVED POWER"},
                        {"black", trimmed_number(black_dbm, 1) + " dBm"},
                        {"white", text(gain_db < 0 ? "limit " : "", trimmed_number(brightest_dbm, 1), " dBm")},
                        {"brightest", brightest}};
    return out;
}

/// A picture with the panel's columns behind its own, or its rows below.
void append(std::vector<std::uint8_t>& image, std::int64_t width, std::int64_t height, bool right, const Panel& panel,
            const std::uint8_t* blank) {
    const auto panel_row = [&](std::int64_t row) {
        return blank ? std::string(static_cast<std::size_t>(panel.width), static_cast<char>(*blank))
                     : std::string(panel.grey.substr(static_cast<std::size_t>(row * panel.width),
                                                     static_cast<std::size_t>(panel.width)));
    };
    std::vector<std::uint8_t> out;
    out.reserve(image.size() + panel.grey.size());
    for (std::int64_t row = 0; row < height; ++row) {
        const auto first = image.begin() + row * width;
        out.insert(out.end(), first, first + width);
        if (!right) continue;
        const std::string more = panel_row(row);
        out.insert(out.end(), more.begin(), more.end());
    }
    for (std::int64_t row = 0; !right && row < panel.height; ++row) {
        const std::string more = panel_row(row);
        out.insert(out.end(), more.begin(), more.end());
    }
    image = std::move(out);
}

}  // namespace

std::string find_picture_helper() {
    std::error_code ignored;
    const auto self = std::filesystem::read_symlink("/proc/self/exe", ignored);
    if (!ignored) {
        const auto beside = self.parent_path() / helper_name;
        if (::access(beside.c_str(), X_OK) == 0) return beside.string();
    }
    if (const char* path = std::getenv("PATH")) {
        for (std::string_view rest = path; !rest.empty();) {
            const auto colon = rest.find(':');
            const auto candidate = std::filesystem::path(rest.substr(0, colon)) / helper_name;
            if (!rest.substr(0, colon).empty() && ::access(candidate.c_str(), X_OK) == 0) return candidate.string();
            rest.remove_prefix(colon == std::string_view::npos ? rest.size() : colon + 1);
        }
    }
    throw IoError(text("legend on needs the program ", helper_name, ", which is neither beside ",
                       in_quotes(self.string()), " nor in PATH"));
}

void add_legend(const std::string& helper, const Settings& settings, const ResolvedScene& scene, Picture& picture) {
    const std::string input =
        legend_text(settings, scene, picture).dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
    const std::string pgm = answer_of(helper, input);
    const Panel panel = read_panel(helper, pgm);
    Frame& frame = picture.frame;
    const bool right = panel.height == frame.height;
    if (!right && panel.width < frame.width)
        throw IoError(text("legend: ", in_quotes(helper), " gave a panel of another size back"));
    const auto outside = static_cast<std::uint8_t>(State::outside);
    if (!right && panel.width > frame.width) {  // narrower than the text
        constexpr std::uint8_t black = 0;
        const Panel more{panel.width - frame.width, frame.height, {}};
        append(picture.grey, frame.width, frame.height, true, more, &black);
        append(picture.state, frame.width, frame.height, true, more, &outside);
        frame.width = panel.width;
    }
    append(picture.grey, frame.width, frame.height, right, panel, nullptr);
    append(picture.state, frame.width, frame.height, right, panel, &outside);
    (right ? frame.width : frame.height) += right ? panel.width : panel.height;
}

}  // namespace wedgescope
