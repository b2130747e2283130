#include "tiles/descriptor.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>

#include "lib/error.hpp"

namespace wedgescope {

Descriptor::Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}

Descriptor& Descriptor::operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
}

Descriptor::~Descriptor() {
    if (number_ >= 0) ::close(number_);
}

namespace {

/// step(bytes done) does some more and returns how much, or -1 with errno. `at_nothing`: the error where it does nothing.
template <class Step>
Transfer all_of(std::size_t count, int at_nothing, const Step& step) {
    Transfer done;
    while (done.bytes < count) {
        const ssize_t n = step(done.bytes);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) {
            done.error = n < 0 ? errno : at_nothing;
            break;
        }
        done.bytes += static_cast<std::size_t>(n);
    }
    return done;
}

}  // namespace

Transfer write_all(int file, const void* from, std::size_t count) noexcept {
    const char* const bytes = static_cast<const char*>(from);
    return all_of(count, ENOSPC, [&](std::size_t done) { return ::write(file, bytes + done, count - done); });
}

Transfer write_all_at(int file, const void* from, std::size_t count, std::uint64_t offset) noexcept {
    const char* const bytes = static_cast<const char*>(from);
    return all_of(count, ENOSPC, [&](std::size_t done) {
        return ::pwrite(file, bytes + done, count - done, static_cast<off_t>(offset + done));
    });
}

Transfer read_all(int file, void* to, std::size_t count) noexcept {
    char* const bytes = static_cast<char*>(to);
    return all_of(count, 0, [&](std::size_t done) { return ::read(file, bytes + done, count - done); });
}

Transfer read_all_at(int file, void* to, std::size_t count, std::uint64_t offset) noexcept {
    char* const bytes = static_cast<char*>(to);
    return all_of(count, 0, [&](std::size_t done) {
        return ::pread(file, bytes + done, count - done, static_cast<off_t>(offset + done));
    });
}

std::string stream_reason() { return errno ? system_reason(errno) : "disk full?"; }

int rename_new(const std::string& from, const std::string& to) noexcept {
    constexpr unsigned no_replacing = 1;
    if (::syscall(SYS_renameat2, AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), no_replacing) == 0) return 0;
    if (errno != EINVAL && errno != ENOSYS && errno != EOPNOTSUPP) return errno;
    // A file system that cannot look and rename at once.
    struct stat facts {};
    if (::lstat(to.c_str(), &facts) == 0) return EEXIST;
    return ::rename(from.c_str(), to.c_str()) == 0 ? 0 : errno;
}

int sync_folder(const std::string& path) noexcept {
    const Descriptor folder(::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (!folder) return errno;
    if (::fsync(folder.get()) == 0 || errno == EINVAL || errno == ENOTSUP || errno == EROFS) return 0;
    return errno;
}

}  // namespace wedgescope
