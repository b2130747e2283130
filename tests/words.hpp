// The words of a command line: some, and some more.
#pragma once
#include <string>
#include <vector>

namespace wedgescope::test {

inline std::vector<std::string> with(std::vector<std::string> words, const std::vector<std::string>& more) {
    words.insert(words.end(), more.begin(), more.end());
    return words;
}

}  // namespace wedgescope::test
