// JSON text: what may be parsed of a file that anyone may have written. Leaves what it means to whoever reads it.
#pragma once
#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <string_view>

namespace wedgescope {

/// Whether no array or object lies in more than `most` others. Writing, comparing and copying a parsed text go one call deeper for
/// each: a few hundred kilobytes of brackets would end the program.
inline bool is_shallow_json(std::string_view text, int most = 64) {
    int depth = 0;
    bool quoted = false;
    for (std::size_t i = 0; i < text.size() && depth <= most; ++i) {
        const char c = text[i];
        if (quoted && c == '\\')
            ++i;
        else if (c == '"')
            quoted = !quoted;
        else if (!quoted)
            depth += c == '[' || c == '{' ? 1 : c == ']' || c == '}' ? -1 : 0;
    }
    return depth <= most;
}

/// nlohmann's value of a text; is_discarded() where that is no JSON, or no shallow one.
template <class Json>
Json parsed_json(std::string_view text) {
    return is_shallow_json(text) ? Json::parse(text, nullptr, false) : Json(Json::value_t::discarded);
}

}  // namespace wedgescope
