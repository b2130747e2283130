#include "tools/libm_variant.hpp"

#include <sys/auxv.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <climits>
#include <cstdlib>
#include <vector>

namespace wedgescope {
namespace {

constexpr const char* variable = "GLIBC_TUNABLES";
constexpr std::string_view key = "glibc.cpu.hwcaps=";
constexpr std::array<std::string_view, 2> hidden = {"-FMA", "-FMA4"};

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
    std::array<char, PATH_MAX + 1> path{};
    if (::readlink("/proc/self/exe", path.data(), PATH_MAX) <= 0 || ::setenv(variable, wanted.c_str(), 1) != 0) return;
    ::execv(path.data(), arguments);
#endif
}

}  // namespace wedgescope
