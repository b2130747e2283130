#include "tools/codec.hpp"

#include <filesystem>

namespace wedgescope::codecs {

std::string words(const Limits& limits) {
    if (limits.low.empty()) return "";
    std::string out = (limits.above ? "above " : limits.high.empty() ? "at least " : "from ") + limits.low;
    if (!limits.high.empty()) out += (limits.below ? " and below " : limits.above ? " up to " : " to ") + limits.high;
    return out;
}

bool begins_with_letter(std::string_view text) {
    return !text.empty() && ((text[0] >= 'a' && text[0] <= 'z') || (text[0] >= 'A' && text[0] <= 'Z'));
}

double parse_given(Dimension dimension, const Given& given) {
    if (given.unit.empty()) return parse_quantity(dimension, given.origin, given.value);
    return parse_quantity_or_number(dimension, given.origin, given.value, given.unit);
}

std::string resolved_path(const Given& given) {
    const std::string path(trimmed(given.value));
    if (path.empty()) throw InputError(text(given.origin, " is empty; a path is needed"));
    if (path.find('\0') != std::string::npos)
        throw InputError(text(given.origin, " is ", in_quotes(path), "; a path holds no zero byte"));
    if (given.folder.empty() || path[0] == '/') return path;
    const auto colon = path.find(':');
    if (colon != std::string::npos && colon >= 2 && path.find('/') > colon) return path;
    return (std::filesystem::path(given.folder) / path).lexically_normal().string();
}

Codec word_of(std::string value, std::string Settings::*field) {
    Codec codec{std::move(value), "", {}, {}};
    codec.set = [=](Settings& s, const Given& given) {
        s.*field = std::string(trimmed(given.value));
        if ((s.*field).empty()) throw InputError(text(given.origin, " is empty"));
    };
    codec.get = [=](const Settings& s) -> std::optional<std::string> {
        return (s.*field).empty() ? std::nullopt : std::optional(s.*field);
    };
    return codec;
}

}  // namespace wedgescope::codecs
