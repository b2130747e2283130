#include "tiles/scratch_file.hpp"

#include <unistd.h>

#include <cerrno>
#include <cstring>
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
                       reason ? std::strerror(reason) : "the file ends early"));
}

void ScratchFile::open() {
    if (file_) return;
    file_ = Descriptor(open_unnamed(folder_));
    if (!file_) fail("made", errno);
}

void ScratchFile::write(std::span<const std::byte> bytes, std::uint64_t offset) {
    open();
    while (!bytes.empty()) {
        const ::ssize_t n = ::pwrite(file_.get(), bytes.data(), bytes.size(), static_cast<::off_t>(offset));
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) fail("written", errno);
        bytes = bytes.subspan(static_cast<std::size_t>(n));
        offset += static_cast<std::uint64_t>(n);
    }
}

void ScratchFile::read(std::span<std::byte> into, std::uint64_t offset) const {
    while (!into.empty()) {
        const ::ssize_t n = ::pread(file_.get(), into.data(), into.size(), static_cast<::off_t>(offset));
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) fail("read", n < 0 ? errno : 0);
        into = into.subspan(static_cast<std::size_t>(n));
        offset += static_cast<std::uint64_t>(n);
    }
}

}  // namespace wedgescope
