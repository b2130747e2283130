#include "tiles/plain_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <vector>

#include "lib/error.hpp"
#include "tiles/checksum.hpp"
#include "tiles/claim.hpp"

namespace wedgescope {
namespace {

[[noreturn]] void fail(const std::string& path, const char* what, int reason = errno) {
    throw IoError(text("'", path, "' cannot be ", what, ": ", system_reason(reason)));
}

}  // namespace

PlainFile::PlainFile(std::string path, Use use) : path_(std::move(path)) {
    file_ = Descriptor(::open(path_.c_str(), (use == Use::read ? O_RDONLY : O_RDWR | O_CREAT) | O_CLOEXEC, 0666));
    if (!file_) fail(path_, "opened");
}

PlainFile::PlainFile(const Unnamed& where) : path_(text(where.what, "' in temp-dir '", where.folder)) {
    file_ = Descriptor(open_unnamed(where.folder));
    if (!file_) fail(path_, "made");
}

std::uint64_t PlainFile::bytes() const {
    struct stat facts {};
    if (::fstat(file_.get(), &facts) != 0) fail(path_, "read");
    return static_cast<std::uint64_t>(facts.st_size);
}

void PlainFile::read(std::uint64_t at, void* out, std::size_t count) const {
    const Transfer done = read_all_at(file_.get(), out, count, at);
    if (done.error) fail(path_, "read", done.error);
    if (done.bytes < count)
        throw IoError(
            text("'", path_, "' ends at byte ", at + done.bytes, ", ", count - done.bytes, " bytes too early"));
}

void PlainFile::write(std::uint64_t at, const void* from, std::size_t count) {
    if (const int error = write_all_at(file_.get(), from, count, at).error) fail(path_, "written", error);
}

void PlainFile::resize(std::uint64_t size) {
    if (::ftruncate(file_.get(), static_cast<off_t>(size)) != 0) fail(path_, "written");
}

void PlainFile::sync() {
    if (::fsync(file_.get()) != 0) fail(path_, "written to disk");
}

bool PlainFile::stands() const { return stands_at(file_.get(), path_); }

bool PlainFile::lock() { return ::flock(file_.get(), LOCK_EX | LOCK_NB) == 0; }

int open_unnamed(const std::string& folder) {
    int file = ::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    if (file < 0 && (errno == EOPNOTSUPP || errno == EISDIR || errno == EINVAL)) {
        std::string path = (std::filesystem::path(folder) / ".wedgescope-scratch-XXXXXX").string();
        file = ::mkostemp(path.data(), O_CLOEXEC);
        if (file >= 0) ::unlink(path.c_str());
    }
    return file;
}

std::uint64_t file_bytes(const std::string& path) {
    struct stat facts {};
    if (::stat(path.c_str(), &facts) != 0) fail(path, "read");
    return static_cast<std::uint64_t>(facts.st_size);
}

std::string file_text(const std::string& path, std::size_t most) {
    const PlainFile file(path, PlainFile::Use::read);
    const std::uint64_t size = file.bytes();
    if (size > most) throw DataError(text("'", path, "' has ", size, " bytes; accepted: at most ", most));
    std::string content(size, '\0');
    file.read(0, content.data(), content.size());
    return content;
}

void replace_file(const std::string& path, const std::string& content) {
    const std::string temporary = path + ".tmp";
    {
        PlainFile file(temporary, PlainFile::Use::write);
        file.resize(0);
        file.write(0, content.data(), content.size());
        file.sync();
    }
    rename_path(temporary, path);
}

void sync_path(const std::string& path, bool folder) {
    if (folder) {
        if (const int error = sync_folder(path)) fail(path, "written to disk", error);
        return;
    }
    const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
    if (!file) fail(path, "opened");
    if (::fsync(file.get()) != 0) fail(path, "written to disk");
}

void begin_sync(const std::string& path) noexcept {
    const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
    if (file) ::sync_file_range(file.get(), 0, 0, SYNC_FILE_RANGE_WRITE);
}

void rename_path(const std::string& from, const std::string& to) {
    if (std::rename(from.c_str(), to.c_str()) != 0) fail(to, "put in place");
}

std::string hex(std::uint64_t sum) { return fmt::format("{:016x}", sum); }

std::uint64_t file_checksum(const std::string& path) {
    constexpr std::size_t piece = std::size_t{1} << 18;
    const PlainFile file(path, PlainFile::Use::read);
    const std::uint64_t size = file.bytes();
    std::vector<char> buffer(piece);
    XXH3_state_t* state = XXH3_createState();
    if (!state) throw IoError("no memory for a checksum");
    XXH3_64bits_reset(state);
    try {
        for (std::uint64_t at = 0; at < size; at += piece) {
            const auto n = static_cast<std::size_t>(size - at < piece ? size - at : piece);
            file.read(at, buffer.data(), n);
            XXH3_64bits_update(state, buffer.data(), n);
        }
    } catch (...) {
        XXH3_freeState(state);
        throw;
    }
    const std::uint64_t sum = XXH3_64bits_digest(state);
    XXH3_freeState(state);
    return sum;
}

}  // namespace wedgescope
