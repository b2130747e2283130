#include "tools/libm_variant.hpp"

#include <sys/auxv.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cinttypes>
#include <climits>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <vector>

namespace wedgescope {
namespace {

constexpr const char* variable = "GLIBC_TUNABLES";
constexpr std::string_view key = "glibc.cpu.hwcaps=";
constexpr std::array<std::string_view, 2> hidden = {"-FMA", "-FMA4"};

/// Path of the file that this function's code lies in, and that the system began; empty where they are two (a loader was begun, and
/// took this program) or cannot be told.
std::string own_path() {
    std::array<char, PATH_MAX + 1> begun{};
    if (::readlink("/proc/self/exe", begun.data(), PATH_MAX) <= 0) return {};
    std::ifstream maps("/proc/self/maps");
    const auto here = reinterpret_cast<std::uintptr_t>(&own_path);
    for (std::string line; std::getline(maps, line);) {
        std::uintptr_t first = 0, last = 0;
        int path = 0;
        if (std::sscanf(line.c_str(), "%" SCNxPTR "-%" SCNxPTR " %*s %*s %*s %*s %n", &first, &last, &path) < 2 ||
            here < first || here >= last)
            continue;
        return line.substr(static_cast<std::size_t>(path)) == begun.data() ? begun.data() : "";
    }
    return {};
}

std::vector<std::string_view> split(std::string_view words, char at) {
    std::vector<std::string_view> parts;
    for (;;) {
        const std::size_t end = words.find(at);
        parts.push_back(words.substr(0, end));
        if (end == std::string_view::npos) return parts;
        words.remove_prefix(end + 1);
    }
}

}  // namespace

std::string without_fma(std::string_view tunables) {
    std::string out, features;
    // Of several settings of one name glibc takes the last.
    for (const std::string_view setting : split(tunables, ':')) {
        if (setting.starts_with(key))
            features = setting.substr(key.size());
        else if (!setting.empty())
            out.append(setting).append(1, ':');
    }
    const std::vector<std::string_view> given = split(features, ',');
    out += key;
    for (const std::string_view feature : given)
        if (!feature.empty() && std::find(hidden.begin(), hidden.end(), feature) == hidden.end())
            out.append(feature).append(1, ',');
    return out.append(hidden[0]).append(1, ',').append(hidden[1]);
}

void hide_fma_from_libm(char** arguments) {
#if defined(__GLIBC__) && defined(__x86_64__)
    if (!__builtin_cpu_supports("fma") && !__builtin_cpu_supports("fma4")) return;
    const char* const given = std::getenv(variable);
    const std::string wanted = without_fma(given ? given : "");
    // Where the system clears the variable (of a program with another user's rights) it would never be as wanted.
    if ((given && wanted == given) || ::getauxval(AT_SECURE) != 0) return;
    if (const char* const as_is = std::getenv("WEDGESCOPE_LIBM"); as_is && std::string_view(as_is) == "as-is") return;
    const std::string path = own_path(), before = given ? given : "";
    if (path.empty() || ::setenv(variable, wanted.c_str(), 1) != 0) return;
    ::execv(path.c_str(), arguments);
    given ? ::setenv(variable, before.c_str(), 1) : ::unsetenv(variable);
#endif
}

}  // namespace wedgescope
