// A test case on every instruction set of the machine.
#pragma once
#include <catch2/catch.hpp>

#include "lib/target.hpp"

namespace wedgescope::test {

/// The target in use, for the time of a scope.
class OnTarget {
public:
    explicit OnTarget(Target target) : before_(target_in_use()) { use_target(target); }
    ~OnTarget() { use_target(before_); }
    OnTarget(const OnTarget&) = delete;
    OnTarget& operator=(const OnTarget&) = delete;

private:
    Target before_;
};

}  // namespace wedgescope::test

/// First in a test case: it runs once on each.
#define WEDGESCOPE_ON_EVERY_TARGET                                            \
    const wedgescope::test::OnTarget on_every_target(                         \
        GENERATE(Catch::Generators::from_range(wedgescope::targets_here()))); \
    INFO("instruction set " << wedgescope::name_of(wedgescope::target_in_use()))
