// Words in lower case, letter by letter, as the C locale has them: endings of file names, names of units and fields.
#pragma once
#include <algorithm>
#include <cctype>
#include <string>

namespace wedgescope {

inline std::string lower_case(std::string words) {
    std::transform(words.begin(), words.end(), words.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return words;
}

}  // namespace wedgescope
