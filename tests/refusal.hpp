// What a refusal says: the message that a body throws.
#pragma once
#include <catch2/catch.hpp>
#include <string>

#include "lib/error.hpp"

namespace wedgescope::test {

inline const std::string nothing_refused = "nothing was refused";

/// What `body` throws as a Kind, which must be one line; nothing_refused if it throws nothing.
template <class Kind = Error, class Body>
std::string refusal(Body&& body) {
    try {
        body();
    } catch (const Kind& e) {
        CHECK_THAT(std::string(e.what()), !Catch::Contains("\n"));
        return e.what();
    }
    return nothing_refused;
}

}  // namespace wedgescope::test
