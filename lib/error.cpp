#include "lib/error.hpp"

#include <fmt/format.h>

#include <iterator>

namespace wedgescope {

void MessagePart::append_to(std::string& out) const {
    const auto write = [&](const auto& number) { fmt::format_to(std::back_inserter(out), "{}", number); };
    switch (kind_) {
        case Kind::words:
            out += words_;
            break;
        case Kind::letter:
            out += letter_;
            break;
        case Kind::real:
            write(real_);
            break;
        case Kind::single:
            write(single_);
            break;
        case Kind::whole:
            write(whole_);
            break;
        case Kind::natural:
            write(natural_);
            break;
    }
}

std::string joined_text(std::initializer_list<MessagePart> parts) {
    std::string out;
    for (const MessagePart& part : parts) part.append_to(out);
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

}  // namespace wedgescope
