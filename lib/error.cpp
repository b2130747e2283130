#include "lib/error.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <system_error>

namespace wedgescope {

void MessagePart::append_to(std::string& out) const {
    std::visit([&](const auto& value) { fmt::format_to(std::back_inserter(out), "{}", value); }, value_);
}

std::string joined_text(std::initializer_list<MessagePart> parts) {
    std::string out;
    for (const MessagePart& part : parts) part.append_to(out);
    return out;
}

std::string listed_names(const std::vector<std::string>& names) {
    constexpr std::size_t most = 8;
    std::string out;
    for (std::size_t i = 0; i < std::min(most, names.size()); ++i) out += text(i ? ", " : "", in_quotes(names[i]));
    if (names.size() > most) out += text(" and ", names.size() - most, " more");
    return out;
}

std::string in_quotes(std::string_view words) {
    constexpr std::size_t longest = 200;
    std::string out = "'";
    for (const char c : words.substr(0, longest)) {
        const auto byte = static_cast<unsigned char>(c);
        out += (byte < 0x20 || byte == 0x7f) ? '?' : c;
    }
    if (words.size() > longest) out += "...";
    return out + "'";
}

std::string system_reason(int error) { return std::generic_category().message(error); }

}  // namespace wedgescope
