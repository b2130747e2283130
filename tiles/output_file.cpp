#include "tiles/output_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <set>
#include <utility>
#include <vector>

#include "lib/error.hpp"

namespace wedgescope {
namespace {

namespace fs = std::filesystem;

struct LiveFiles {
    std::mutex mutex;
    std::set<std::string> paths;
};
LiveFiles& live() {
    static LiveFiles files;
    return files;
}

std::string folder_of(const std::string& path) {
    const std::string folder = fs::path(path).parent_path().string();
    return folder.empty() ? "." : folder;
}

/// The temporary file and what drivers write beside it (scope.tmp-7-1.png, .png.aux.xml, .hdr, ...): what comes
/// behind the common stem of their names.
std::vector<std::string> endings(const std::string& path) {
    const std::string stem = fs::path(path).stem().string();
    std::vector<std::string> found;
    std::error_code error;
    for (fs::directory_iterator entry(folder_of(path), error), end; !error && entry != end; entry.increment(error)) {
        const std::string name = entry->path().filename().string();
        if (name == stem || name.starts_with(stem + ".")) found.push_back(name.substr(stem.size()));
    }
    return found;
}

std::string with_ending(const std::string& path, const std::string& ending) {
    const fs::path whole(path);
    return (whole.parent_path() / (whole.stem().string() + ending)).string();
}

void remove_family(const std::string& temporary_path) noexcept {
    try {
        std::error_code ignored;
        for (const std::string& ending : endings(temporary_path))
            fs::remove(with_ending(temporary_path, ending), ignored);
    } catch (...) {  // out of memory: the file itself at least
        ::unlink(temporary_path.c_str());
    }
}

void sync(const std::string& path, const std::string& final_path, bool folder) {
    const int file = ::open(path.c_str(), folder ? O_RDONLY | O_DIRECTORY : O_RDONLY);
    bool good = file >= 0;
    int reason = errno;
    // Some file systems cannot sync a folder; the names are then as safe as they get.
    if (good && ::fsync(file) != 0 && !(folder && (errno == EINVAL || errno == ENOTSUP || errno == EROFS))) {
        good = false;
        reason = errno;
    }
    if (file >= 0 && ::close(file) != 0 && good) {
        good = false;
        reason = errno;
    }
    if (!good) throw IoError(text("output '", final_path, "' cannot be written to disk: ", std::strerror(reason)));
}

constexpr const char* side_files[] = {".aux.xml", ".geoloc.tif"};

}  // namespace

OutputFile::OutputFile(std::string final_path, bool overwrite)
    : final_path_(std::move(final_path)), overwrite_(overwrite) {
    if (final_path_.empty()) throw InputError("output has an empty name; accepted: the path of a file");
    const std::string folder = folder_of(final_path_);
    struct stat facts {};
    if (::stat(folder.c_str(), &facts) != 0)
        throw IoError(text("output '", final_path_, "': folder '", folder, "' cannot be used: ", std::strerror(errno)));
    if (!S_ISDIR(facts.st_mode)) throw IoError(text("output '", final_path_, "': '", folder, "' is not a folder"));
    if (::stat(final_path_.c_str(), &facts) == 0 && S_ISDIR(facts.st_mode))
        throw InputError(text("output '", final_path_, "' is a folder; accepted: the path of a file"));
    refuse_existing();
    if (::access(folder.c_str(), W_OK | X_OK) != 0)
        throw IoError(
            text("output '", final_path_, "': folder '", folder, "' is not writable: ", std::strerror(errno)));

    static std::atomic<unsigned> number{0};
    const fs::path whole(final_path_);
    temporary_path_ = (whole.parent_path() /
                       text(whole.stem().string(), ".tmp-", ::getpid(), "-", ++number, whole.extension().string()))
                          .string();
    const std::lock_guard lock(live().mutex);
    live().paths.insert(temporary_path_);
}

OutputFile::OutputFile(OutputFile&& other) noexcept
    : final_path_(std::move(other.final_path_)), temporary_path_(std::exchange(other.temporary_path_, {})),
      overwrite_(other.overwrite_) {}

OutputFile::~OutputFile() {
    if (temporary_path_.empty()) return;
    remove_family(temporary_path_);
    const std::lock_guard lock(live().mutex);
    live().paths.erase(temporary_path_);
}

void OutputFile::refuse_existing() const {
    struct stat facts {};
    if (!overwrite_ && ::lstat(final_path_.c_str(), &facts) == 0)
        throw InputError(text("output '", final_path_, "' exists; add --overwrite"));
}

void OutputFile::commit() {
    refuse_existing();
    const std::string own = fs::path(temporary_path_).extension().string();
    const std::vector<std::string> found = endings(temporary_path_);
    for (const std::string& ending : found) sync(with_ending(temporary_path_, ending), final_path_, false);

    // Side files of what stood there before do not belong to the new file.
    for (const char* side : side_files)
        if (::unlink((final_path_ + side).c_str()) != 0 && errno != ENOENT)
            throw IoError(text("old side file '", final_path_, side, "' cannot be removed: ", std::strerror(errno)));
    const auto rename_one = [&](const std::string& ending) {
        const std::string from = with_ending(temporary_path_, ending), to = with_ending(final_path_, ending);
        if (::rename(from.c_str(), to.c_str()) != 0)
            throw IoError(text("output '", to, "' cannot be put in place of '", from, "': ", std::strerror(errno)));
    };
    for (const std::string& ending : found)
        if (ending != own) rename_one(ending);
    rename_one(own);  // last: who sees the name sees everything
    sync(folder_of(final_path_), final_path_, true);

    const std::lock_guard lock(live().mutex);
    live().paths.erase(temporary_path_);
    temporary_path_.clear();
}

void remove_temporary_files() noexcept {
    // Also called when everything breaks down: does not wait for whoever holds the list.
    const std::unique_lock lock(live().mutex, std::try_to_lock);
    if (!lock.owns_lock()) return;
    for (const std::string& path : live().paths) remove_family(path);
    live().paths.clear();
}

void write_text(const std::string& path, const std::string& content, bool overwrite) {
    OutputFile file(path, overwrite);
    errno = 0;
    std::ofstream out(file.temporary_path(), std::ios::binary);
    out.write(content.data(), static_cast<std::streamsize>(content.size()));
    out.close();
    if (!out)
        throw IoError(text("output '", path, "' cannot be written: ", errno ? std::strerror(errno) : "disk full?"));
    file.commit();
}

}  // namespace wedgescope
