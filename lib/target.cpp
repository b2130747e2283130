#include "lib/target.hpp"

#include <hwy/targets.h>

#include <algorithm>
#include <cstdlib>

#include "lib/error.hpp"

namespace wedgescope {
namespace {

constexpr const char* variable = "WEDGESCOPE_TARGET";

#if HWY_ARCH_X86
/// Highway's bit of a target; none for the baseline, which Highway falls back to without any.
constexpr std::array<std::int64_t, target_names.size()> highway_bits{0, HWY_SSE4, HWY_AVX2, HWY_AVX3};
#else
constexpr std::array<std::int64_t, target_names.size()> highway_bits{};
#endif

/// Those up to `target`, so that a loop that Highway could not compile for it runs on the next one.
std::int64_t highway_bits_up_to(Target target) {
    std::int64_t bits = 0;
    for (std::size_t i = 0; i <= static_cast<std::size_t>(target); ++i) bits |= highway_bits[i];
    return bits;
}

void put(Target target) {
    detail::target_in_use.store(target, std::memory_order_relaxed);
#if HWY_ARCH_X86
    hwy::GetChosenTarget().Update(highway_bits_up_to(target));
#endif
}

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
    std::vector<Target> here{Target::baseline};
    const std::int64_t supported = hwy::SupportedTargets();
    for (std::size_t i = 1; i < target_names.size(); ++i)
        if (supported & highway_bits[i]) here.push_back(static_cast<Target>(i));
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
