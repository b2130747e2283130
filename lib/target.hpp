// Target: the set of instructions that the hot loops run on, one for the whole program, and the variable of the environment
// that forces it. Leaves how a loop is compiled for each of them to lanes.hpp and Highway.
//
// Every target gives the same bits. Both ways to compile a loop follow the one choice: what lanes.hpp copies and what Highway
// compiles (highway_copies.hpp).
#pragma once
#include <array>
#include <atomic>
#include <cstddef>
#include <vector>

namespace wedgescope {

/// What the compiler takes for granted (SSE2 on x86-64; all there is on other processors), and what is asked of the machine
/// for more. As Highway's of these names: SSE4.2 with AES and PCLMUL, AVX2 with BMI, LZCNT, FMA (not used) and F16C, AVX-512 F,
/// BW, DQ and VL.
enum class Target { baseline, sse4, avx2, avx512 };
inline constexpr std::array<const char*, 4> target_names{"baseline", "sse4", "avx2", "avx512"};

constexpr const char* name_of(Target target) { return target_names[static_cast<std::size_t>(target)]; }

/// Those that this machine can run, the plainest first: baseline always, the last one is what `auto` takes.
std::vector<Target> targets_here();

/// From now on; not while a loop runs. InputError where the machine has no such instructions.
void use_target(Target target);

/// As the environment's WEDGESCOPE_TARGET says: a name of target_names, or `auto`; unset and empty are `auto`.
/// InputError for any other word and for what the machine cannot run.
void use_target_of_environment();

namespace detail {
extern std::atomic<Target> target_in_use;
}

/// The last of targets_here() where nobody has chosen.
inline Target target_in_use() noexcept { return detail::target_in_use.load(std::memory_order_relaxed); }

}  // namespace wedgescope
