#include "tools/text_file.hpp"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "lib/error.hpp"

namespace wedgescope {

std::string text_of_file(const std::string& subject, const std::string& path, std::string_view holds,
                         std::size_t most_mib) {
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored)) throw IoError(text(subject, " is a folder"));
    errno = 0;
    std::ifstream file(path, std::ios::binary);
    if (!file) throw IoError(text(subject, " cannot be opened: ", std::strerror(errno)));
    const std::size_t most = most_mib << 20;
    std::string content;
    // Piece by piece: a file of no size, such as a pipe's, is read too.
    std::string piece(std::size_t{1} << 16, '\0');
    while (content.size() <= most && file) {
        file.read(piece.data(), static_cast<std::streamsize>(piece.size()));
        content.append(piece, 0, static_cast<std::size_t>(file.gcount()));
    }
    if (file.bad()) throw IoError(text(subject, " cannot be read"));
    if (content.size() > most) throw InputError(text(subject, " is larger than ", most_mib, " MiB; ", holds));
    if (content.find('\0') != std::string::npos) throw InputError(text(subject, " is no text; ", holds));
    return content;
}

}  // namespace wedgescope
