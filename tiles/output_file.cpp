#include "tiles/output_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <utility>

#include "lib/error.hpp"
#include "tiles/checksum.hpp"
#include "tiles/folder_entries.hpp"

namespace wedgescope {
namespace {

namespace fs = std::filesystem;

std::string folder_of(const std::string& path) {
    const std::string folder = fs::path(path).parent_path().string();
    return folder.empty() ? "." : folder;
}

bool stands(const std::string& path) {
    struct stat facts {};
    return ::lstat(path.c_str(), &facts) == 0;
}

void sync(const std::string& path, const std::string& final_path, bool folder) {
    int error = 0;
    if (folder) {
        error = sync_folder(path);
    } else {
        Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
        // What the close says counts too.
        if (!file || ::fsync(file.get()) != 0 || ::close(file.release()) != 0) error = errno;
    }
    if (error) throw IoError(text("output '", final_path, "' cannot be written to disk: ", system_reason(error)));
}

constexpr const char* temporary_mark = ".tmp-";

/// Of the final name: what the names of its temporary folders begin with. File systems take names of 255 bytes: of a long one
/// its beginning, up to a whole letter, and a sum of all.
std::string stem_of(const std::string& name) {
    constexpr std::size_t longest = 200;
    if (name.size() <= longest) return text(".", name, temporary_mark);
    std::size_t end = longest;
    while (end > 0 && (static_cast<unsigned char>(name[end]) & 0xC0U) == 0x80U) --end;
    return text(".", name.substr(0, end), "-", checksum(name.data(), name.size()), temporary_mark);
}

/// What stood under temporary names in each folder when this process first wrote there: a folder is listed once, however
/// many files go into it.
class LeftBehind {
public:
    /// Removes those of one final name, the first time that it comes.
    void remove(const std::string& folder, const std::string& stem) {
        const std::lock_guard lock(mutex_);
        const auto [listed, fresh] = folders_.try_emplace(fs::absolute(folder).string());
        if (fresh) list(folder, listed->second);
        const auto [begin, end] = listed->second.equal_range(stem);
        for (auto name = begin; name != end; ++name) remove_unclaimed((fs::path(folder) / name->second).string());
        listed->second.erase(begin, end);
    }

private:
    using Names = std::multimap<std::string, std::string>;  ///< by stem
    static void list(const std::string& folder, Names& names) {
        std::error_code error, unknown;
        for (const fs::directory_entry& entry : folder_entries(folder, error)) {
            std::string name = entry.path().filename().string();
            const auto mark = name.rfind(temporary_mark);
            if (name.front() != '.' || mark == std::string::npos) continue;
            std::string stem = name.substr(0, mark + std::strlen(temporary_mark));
            // A folder, of two numbers: what only looks a little like it is somebody else's.
            if (is_numbered(name, stem) && name.find('-', stem.size()) != std::string::npos &&
                entry.is_directory(unknown))
                names.emplace(std::move(stem), std::move(name));
        }
    }
    std::mutex mutex_;
    std::map<std::string, Names> folders_;
};

/// A link to what a process has open, as /dev/stdout is: to be written to through it, and never to be replaced.
bool leads_to_open_file(fs::path path) {
    std::error_code error;
    for (int links = 0; links < 40 && fs::is_symlink(path, error); ++links) {
        const fs::path target = fs::read_symlink(path, error);
        path = path.parent_path() / target;  // the target where it begins with /
        if (const std::string text = path.lexically_normal().string(); text.starts_with("/proc/")) return true;
    }
    return false;
}

}  // namespace

void OutputFile::check(const std::string& final_path, bool overwrite) {
    if (final_path.empty()) throw InputError("output has an empty name; accepted: the path of a file");
    if (final_path == "-")
        throw InputError(
            "output '-' is no file; accepted: the path of one (./- if that is its name): of what is written to files, "
            "standard output takes evaluate's table alone");
    const std::string parent = folder_of(final_path), name = fs::path(final_path).filename().string();
    struct stat facts {};
    if (::stat(parent.c_str(), &facts) != 0)
        throw IoError(text("output '", final_path, "': folder '", parent, "' cannot be used: ", system_reason(errno)));
    if (!S_ISDIR(facts.st_mode)) throw IoError(text("output '", final_path, "': '", parent, "' is not a folder"));
    if (name.empty() || (::stat(final_path.c_str(), &facts) == 0 && S_ISDIR(facts.st_mode)))
        throw InputError(text("output '", final_path, "' is a folder; accepted: the path of a file"));
    if ((::stat(final_path.c_str(), &facts) == 0 && !S_ISREG(facts.st_mode)) || leads_to_open_file(final_path))
        throw InputError(text("output '", final_path, "' is a device or a pipe; accepted: the path of a plain file"));
    if (!overwrite && stands(final_path)) throw InputError(text("output '", final_path, "' exists; add --overwrite"));
    for (const char* side : side_files)
        if (!overwrite && stands(final_path + side))
            throw InputError(text("output '", final_path, "': a file '", final_path, side,
                                  "' exists, which would be taken for a part of it; add --overwrite"));
}

OutputFile::OutputFile(std::string final_path, bool overwrite)
    : final_path_(std::move(final_path)), overwrite_(overwrite) {
    check(final_path_, overwrite_);
    const std::string parent = folder_of(final_path_), name = fs::path(final_path_).filename().string();
    const std::string stem = stem_of(name);
    static LeftBehind left_behind;
    left_behind.remove(parent, stem);
    // Its own folder tells at once whether anything can be written here: permissions alone do not (root, read-only and
    // special file systems).
    static std::atomic<unsigned> number{0};
    do {
        folder_ = (fs::path(final_path_).parent_path() / text(stem, ::getpid(), "-", ++number)).string();
        if (::mkdir(folder_.c_str(), 0777) != 0) {
            const int reason = errno;
            folder_.clear();
            if (reason == EEXIST) continue;  // of another machine's process of the same number
            throw IoError(
                text("output '", final_path_, "' cannot be written in folder '", parent, "': ", system_reason(reason)));
        }
        claim_ = Descriptor(::open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
        claim(claim_.get());
        // Until it is claimed another process may take it for one left behind, and remove it.
    } while (folder_.empty() || !(claim_ ? stands_at(claim_.get(), folder_) : stands(folder_)));
    temporary_path_ = (fs::path(folder_) / name).string();
}

OutputFile::OutputFile(OutputFile&& other) noexcept
    : final_path_(std::move(other.final_path_)), folder_(std::exchange(other.folder_, {})),
      temporary_path_(std::exchange(other.temporary_path_, {})), claim_(std::move(other.claim_)),
      overwrite_(other.overwrite_) {}

OutputFile::~OutputFile() { remove_folder(); }

void OutputFile::remove_folder() noexcept {
    if (folder_.empty()) return;
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
    claim_ = Descriptor();
    folder_.clear();
    temporary_path_.clear();
}

std::vector<std::string> OutputFile::written() const {
    std::vector<std::string> names;
    std::error_code error;
    for (const fs::directory_entry& entry : folder_entries(folder_, error))
        names.push_back(entry.path().filename().string());
    if (error)
        throw IoError(
            text("output '", final_path_, "': what was written for it to '", folder_, "' is gone: ", error.message()));
    // The file itself last: who sees the name sees everything.
    const std::string own = fs::path(final_path_).filename().string();
    std::sort(names.begin(), names.end(), [&](const std::string& a, const std::string& b) {
        return std::pair(a == own, a) < std::pair(b == own, b);
    });
    return names;
}

void OutputFile::commit(const std::vector<OutputFile*>& files, const MayReplace& may_replace) {
    struct Move {
        const OutputFile* file;
        std::string from, to;
    };
    std::vector<Move> moves;
    std::map<std::string, const OutputFile*> targets;
    for (const OutputFile* file : files) {
        const fs::path parent = fs::path(file->final_path_).parent_path();
        for (const std::string& name : file->written()) {
            const std::string from = (fs::path(file->folder_) / name).string(), to = (parent / name).string();
            std::error_code error;
            const fs::path whole = fs::weakly_canonical(fs::absolute(to, error), error);
            const std::string key = error ? to : whole.string();
            const auto [other, fresh] = targets.emplace(key, file);
            if (!fresh)
                throw InputError(text("outputs '", other->second->final_path_, "' and '", file->final_path_,
                                      "' both need the file '", to, "'; give them different names"));
            if (!file->overwrite_ && stands(to))
                throw InputError(text("output '", file->final_path_, "': the file '", to, "' exists; add --overwrite"));
            if (may_replace && to != file->final_path_ && stands(to)) may_replace(*file, to);
            sync(from, file->final_path_, false);
            moves.push_back({file, from, to});
        }
    }
    // Side files of what stood there before do not belong to the new file; where that cannot come, they stay with the old one.
    std::vector<Move> stale;
    std::vector<Move> beside;  // new side files whose file is not there yet
    const auto put_back = [&] {
        for (const Move& move : beside) ::unlink(move.to.c_str());
        for (const Move& aside : stale) ::rename(aside.to.c_str(), aside.from.c_str());
    };
    const auto set_aside = [&](const OutputFile* file, const std::string& old) {
        Move aside{file, old, (fs::path(file->folder_) / text("before.", fs::path(old).filename().string())).string()};
        std::error_code ignored;
        const bool folder = fs::is_directory(fs::symlink_status(aside.from, ignored));
        if (!folder && ::rename(aside.from.c_str(), aside.to.c_str()) == 0) {
            stale.push_back(std::move(aside));
        } else if (const int reason = folder ? EISDIR : errno; reason != ENOENT) {
            put_back();
            throw IoError(text("old side file '", aside.from, "' cannot be removed: ", system_reason(reason)));
        }
    };
    for (const OutputFile* file : files)
        for (const char* side : side_files)
            if (file->overwrite_) set_aside(file, file->final_path_ + side);
    // And those that a new one of the same name replaces.
    for (const Move& move : moves)
        if (move.file->overwrite_ && move.to != move.file->final_path_) set_aside(move.file, move.to);
    for (const Move& move : moves) {
        // What came to stand there meanwhile stays as well.
        const int reason = !move.file->overwrite_                              ? rename_new(move.from, move.to)
                           : ::rename(move.from.c_str(), move.to.c_str()) == 0 ? 0
                                                                               : errno;
        if (reason != 0) {
            put_back();
            throw IoError(text("output '", move.to, "' cannot be put in place: ", system_reason(reason)));
        }
        beside.push_back(move);
        if (move.to == move.file->final_path_) {
            const auto own = [&](const Move& other) { return other.file == move.file; };
            std::erase_if(stale, own);
            std::erase_if(beside, own);
        }
    }
    for (OutputFile* file : files) {
        sync(folder_of(file->final_path_), file->final_path_, true);
        file->remove_folder();
    }
}

}  // namespace wedgescope
