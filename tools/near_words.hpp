// Near words: what a word that nobody knows was meant to be.
// Leaves to the callers which words there are.
#pragma once
#include <string>
#include <string_view>
#include <vector>

namespace wedgescope {

/// "; did you mean x?", with the word of `known` that is near enough to be meant and `prefix` before it; nothing where
/// none is.
std::string suggestion(std::string_view word, const std::vector<std::string>& known, const char* prefix = "");

}  // namespace wedgescope
