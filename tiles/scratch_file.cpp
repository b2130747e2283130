#include "tiles/scratch_file.hpp"

#include <unistd.h>

#include <cerrno>
#include <utility>

#include "lib/error.hpp"
#include "tiles/plain_file.hpp"
#include "tiles/spill.hpp"

namespace wedgescope {

ScratchFile::ScratchFile(std::string folder, std::string what, std::string given_as)
    : folder_(folder.empty() ? temporary_folder() : std::move(folder)), what_(std::move(what)),
      given_as_(std::move(given_as)) {}

void ScratchFile::fail(const char* what, int reason) const {
    throw IoError(text(what_, " in ", given_as_, " '", folder_, "' cannot be ", what, ": ",
                       reason ? system_reason(reason) : "the file ends early"));
}

void ScratchFile::open() {
    if (file_) return;
    file_ = Descriptor(open_unnamed(folder_));
    if (!file_) fail("made", errno);
}

void ScratchFile::write(std::span<const std::byte> bytes, std::uint64_t offset) {
    open();
    if (const int error = write_all_at(file_.get(), bytes.data(), bytes.size(), offset).error) fail("written", error);
}

void ScratchFile::read(std::span<std::byte> into, std::uint64_t offset) const {
    const Transfer done = read_all_at(file_.get(), into.data(), into.size(), offset);
    if (done.bytes < into.size()) fail("read", done.error);
}

}  // namespace wedgescope
