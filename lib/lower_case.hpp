// Words in lower case, letter by letter, as the C locale has them: endings of file names, names of units, fields and columns.
#pragma once
#include <algorithm>
#include <cctype>
#include <string>
#include <string_view>

namespace wedgescope {

inline std::string lower_case(std::string words) {
    std::transform(words.begin(), words.end(), words.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return words;
}

inline bool same_letters(std::string_view a, std::string_view b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                      [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
}

}  // namespace wedgescope
