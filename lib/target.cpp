#include "lib/target.hpp"

#include <algorithm>
#include <cstdlib>

#include "lib/error.hpp"

namespace wedgescope {
namespace {

constexpr const char* variable = "WEDGESCOPE_TARGET";

/// Of this machine and its operating system.
bool can_run([[maybe_unused]] Target target) {
#if defined(__x86_64__)
    switch (target) {
        case Target::baseline:
            return true;
        case Target::sse4:
            return __builtin_cpu_supports("sse4.2") && __builtin_cpu_supports("aes") &&
                   __builtin_cpu_supports("pclmul");
        case Target::avx2:
#if !defined(__clang__)  // knows no names for these two, which came with AVX2
            if (!__builtin_cpu_supports("f16c") || !__builtin_cpu_supports("lzcnt")) return false;
#endif
            return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2") &&
                   __builtin_cpu_supports("fma");
        case Target::avx512:
            return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                   __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
    }
#endif
    return target == Target::baseline;
}

void put(Target target) { detail::target_in_use.store(target, std::memory_order_relaxed); }

std::string accepted_here() {
    std::string names = "auto";
    for (const Target target : targets_here()) names += text(", ", name_of(target));
    return text("this machine accepts ", names);
}

/// Before main: what nobody chooses runs on the best there is.
[[maybe_unused]] const bool best_is_chosen = [] {
    put(targets_here().back());
    return true;
}();

}  // namespace

constinit std::atomic<Target> detail::target_in_use{Target::baseline};

std::vector<Target> targets_here() {
    // Each holds the plainer ones.
    std::vector<Target> here;
    for (std::size_t i = 0; i < target_names.size() && can_run(static_cast<Target>(i)); ++i)
        here.push_back(static_cast<Target>(i));
    return here;
}

void use_target(Target target) {
    const std::vector<Target> here = targets_here();
    if (std::find(here.begin(), here.end(), target) == here.end())
        throw InputError(text("the instruction set ", name_of(target), " is not on this machine; ", accepted_here()));
    put(target);
}

void use_target_of_environment() {
    const char* found = std::getenv(variable);
    const std::string word = found ? found : "";
    const std::vector<Target> here = targets_here();
    if (word.empty() || word == "auto") return put(here.back());
    for (const Target target : here)
        if (word == name_of(target)) return put(target);
    const bool known = std::find(target_names.begin(), target_names.end(), word) != target_names.end();
    throw InputError(text("the environment's ", variable, " is '", word, "', ",
                          known ? "which this machine cannot run" : "which is no instruction set", "; ",
                          accepted_here()));
}

}  // namespace wedgescope
