#include "tools/codec.hpp"

#include <filesystem>
#include <optional>

#include "tools/run_files.hpp"

namespace wedgescope::codecs {
namespace {

/// Without "." and "..", but where a link on the way makes that another place.
std::string tidy(const std::filesystem::path& path) {
    const std::string given = path.string(), normal = path.lexically_normal().string();
    return canonical_path(given) == canonical_path(normal) ? normal : given;
}

/// With the folder before what begins at `begin` of it, if from there to some end a file's name stands that lies in the folder.
std::optional<std::string> from_folder(const std::string& folder, const std::string& path, std::size_t begin,
                                       const char* ends) {
    for (std::size_t end = path.size(); end != std::string::npos && end > begin;
         end = path.find_last_of(ends, end - 1)) {
        const std::filesystem::path file = std::filesystem::path(folder) / path.substr(begin, end - begin);
        std::error_code gone;
        if (std::filesystem::is_regular_file(file, gone)) return path.substr(0, begin) + tidy(file) + path.substr(end);
    }
    return std::nullopt;
}

/// What a driver reads by a name of its own (NETCDF:"x.nc":v), or out of an archive (/vsizip/x.zip/y.tif), if its file lies in the
/// folder.
std::optional<std::string> inside_file_of(const std::string& folder, const std::string& path) {
    for (const std::string archive : {"/vsizip/", "/vsitar/", "/vsigzip/"})
        if (path.starts_with(archive) && path.size() > archive.size() && path[archive.size()] != '/')
            return from_folder(folder, path, archive.size(), "/");
    if (path[0] == '/') return std::nullopt;
    for (std::size_t colon = path.find(':'); colon != std::string::npos; colon = path.find(':', colon + 1)) {
        const bool quoted = path[colon + 1] == '"';
        const std::size_t begin = colon + (quoted ? 2 : 1);
        if (begin >= path.size() || path[begin] == '/') continue;
        if (auto found = from_folder(folder, path, begin, quoted ? "\"" : ":")) return found;
    }
    return std::nullopt;
}

}  // namespace

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
    if (given.folder.empty()) return path;
    const auto colon = path.find(':');
    if (path[0] == '/' || (colon != std::string::npos && colon >= 2 && path.find('/') > colon))
        return inside_file_of(given.folder, path).value_or(path);
    return tidy(std::filesystem::path(given.folder) / path);
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
