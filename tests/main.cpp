// The entry point of every test program; like the program's it heeds the environment's WEDGESCOPE_TARGET.
#define CATCH_CONFIG_RUNNER
#include <catch2/catch.hpp>

#include <cstdio>

#include "lib/error.hpp"
#include "lib/target.hpp"

int main(int count, char** arguments) {
    try {
        wedgescope::use_target_of_environment();
    } catch (const wedgescope::InputError& e) {
        std::fprintf(stderr, "%s\n", e.what());
        return 2;
    }
    return Catch::Session().run(count, arguments);
}
