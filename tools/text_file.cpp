#include "tools/text_file.hpp"

#include <atomic>

#include "lib/error.hpp"
#include "tools/table_stream.hpp"

namespace wedgescope {

namespace {

const Stop never;
std::atomic<const Stop*> stop_of_reads{&never};

}  // namespace

StopsTextReads::StopsTextReads(const Stop& stop) : before_(stop_of_reads.exchange(&stop)) {}

StopsTextReads::~StopsTextReads() { stop_of_reads = before_; }

std::string text_of_file(const std::string& subject, const std::string& path, std::string_view holds,
                         std::size_t most_mib) {
    TableStream file(path == "-" ? "./-" : path, subject, *stop_of_reads);  // standard input is none of these files
    const std::size_t most = most_mib << 20;
    std::string content;
    // Piece by piece: a file of no size, such as a pipe's, is read too.
    std::string piece(std::size_t{1} << 16, '\0');
    while (content.size() <= most && file) {
        file.read(piece.data(), static_cast<std::streamsize>(piece.size()));
        content.append(piece, 0, static_cast<std::size_t>(file.gcount()));
    }
    if (content.size() > most) throw InputError(text(subject, " is larger than ", most_mib, " MiB; ", holds));
    if (content.find('\0') != std::string::npos) throw InputError(text(subject, " is no text; ", holds));
    return content;
}

}  // namespace wedgescope
