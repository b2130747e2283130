#include "tools/terminal.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>

#include "lib/error.hpp"

namespace wedgescope {

Progress::Progress(bool quiet) : on_(!quiet && ::isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() {
    if (on_ && ticks_ >= 0) std::fputc('\n', stderr);
}

void Progress::report(double fraction) {
    if (!on_) return;
    const int reached = std::clamp(static_cast<int>(fraction * 40 + 1e-9), 0, 40);
    while (ticks_ < reached) {
        ++ticks_;
        if (ticks_ % 4 == 0) {
            std::fprintf(stderr, "%d", ticks_ / 4 * 10);
        } else {
            std::fputc('.', stderr);
        }
    }
    std::fflush(stderr);
}

void Progress::done() {
    if (!on_) return;
    report(1);
    std::fputs(" - done.\n", stderr);
    on_ = false;
}

void remark(bool quiet, std::string_view line) {
    if (!quiet) std::fputs((one_line(line) + "\n").c_str(), stderr);
}

void say_as_it_is(const std::string& lines) { std::fputs(lines.c_str(), stderr); }

std::string unused_line(const std::string& why) { return text("not used: ", why); }

void remark_unused(bool quiet, const std::string& why) {
    if (!why.empty()) remark(quiet, unused_line(why));
}

std::string one_line(std::string_view message) {
    std::string out;
    for (const char c : message) {
        const auto byte = static_cast<unsigned char>(c);
        out += (byte < 0x20 || byte == 0x7f) ? ' ' : c;
    }
    while (!out.empty() && out.back() == ' ') out.pop_back();
    return out;
}

void print(std::string_view result) {
    errno = 0;
    if (std::fwrite(result.data(), 1, result.size(), stdout) != result.size() || std::fflush(stdout) != 0) {
        throw IoError(text("cannot write to standard output: ", system_reason(errno)));
    }
}

std::string readable_bytes(double bytes) {
    static constexpr const char* units[] = {"B", "KiB", "MiB", "GiB", "TiB"};
    std::size_t unit = 0;
    while (bytes >= 1024 && unit + 1 < std::size(units)) {
        bytes /= 1024;
        ++unit;
    }
    return unit == 0 ? fmt::format("{:.0f} B", bytes) : fmt::format("{:.1f} {}", bytes, units[unit]);
}

std::string grouped(std::uint64_t number) {
    const std::string plain = text(number);
    std::string digits;
    for (std::size_t i = 0; i < plain.size(); ++i) {
        if (i > 0 && (plain.size() - i) % 3 == 0) digits += ' ';
        digits += plain[i];
    }
    return digits;
}

std::string counted(std::uint64_t number, std::string_view noun) {
    return text(grouped(number), " ", noun, number == 1 ? "" : "s");
}

}  // namespace wedgescope
