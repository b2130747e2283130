#include "tiles/claim.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <vector>

#include "tiles/folder_entries.hpp"

namespace wedgescope {

namespace fs = std::filesystem;

void claim(int file) {
    while (::flock(file, LOCK_EX) != 0 && errno == EINTR) {
    }
}

bool stands_at(int file, const std::string& path) {
    struct stat open {
    }, named{};
    return ::fstat(file, &open) == 0 && ::lstat(path.c_str(), &named) == 0 && open.st_dev == named.st_dev &&
           open.st_ino == named.st_ino;
}

void remove_unclaimed(const std::string& path) {
    std::error_code ignored;
    const Descriptor left(::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
    if (left && ::flock(left.get(), LOCK_EX | LOCK_NB) == 0 && stands_at(left.get(), path))
        fs::remove_all(path, ignored);
}

void remove_left_behind(const std::string& folder, const std::function<bool(const std::string& name)>& temporary) {
    std::error_code error;
    for (const fs::directory_entry& entry : folder_entries(folder, error))
        if (temporary(entry.path().filename().string())) remove_unclaimed(entry.path().string());
}

bool is_numbered(const std::string& name, const std::string& stem) {
    if (!name.starts_with(stem) || name.size() == stem.size()) return false;
    bool digit = false;
    return std::all_of(name.begin() + static_cast<std::ptrdiff_t>(stem.size()), name.end(),
                       [&](char c) {
                           const bool hyphen = c == '-' && digit;
                           digit = c >= '0' && c <= '9';
                           return digit || hyphen;
                       }) &&
           digit;
}

}  // namespace wedgescope
