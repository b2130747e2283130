#include "tiles/plain_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "lib/error.hpp"
#include "tiles/claim.hpp"

namespace wedgescope {
namespace {

[[noreturn]] void fail(const std::string& named, const char* what, int reason = errno) {
    throw IoError(text(named, " cannot be ", what, ": ", system_reason(reason)));
}

}  // namespace

PlainFile::PlainFile(std::string path, Use use, const std::string& becomes)
    : path_(std::move(path)), named_(in_quotes(becomes.empty() ? path_ : becomes)) {
    file_ = Descriptor(::open(path_.c_str(), (use == Use::read ? O_RDONLY : O_RDWR | O_CREAT) | O_CLOEXEC, 0666));
    if (!file_) fail(named_, "opened");
}

PlainFile::PlainFile(const Unnamed& where)
    : named_(text(in_quotes(where.what), " in temp-dir ", in_quotes(where.folder))) {
    file_ = Descriptor(open_unnamed(where.folder));
    if (!file_) fail(named_, "made");
}

std::uint64_t PlainFile::bytes() const {
    struct stat facts {};
    if (::fstat(file_.get(), &facts) != 0) fail(named_, "read");
    return static_cast<std::uint64_t>(facts.st_size);
}

void PlainFile::read(std::uint64_t at, void* out, std::size_t count) const {
    const Transfer done = read_all_at(file_.get(), out, count, at);
    if (done.error) fail(named_, "read", done.error);
    if (done.bytes < count)
        throw IoError(text(named_, " ends at byte ", at + done.bytes, ", ", count - done.bytes, " bytes too early"));
}

void PlainFile::write(std::uint64_t at, const void* from, std::size_t count) {
    if (const int error = write_all_at(file_.get(), from, count, at).error) fail(named_, "written", error);
}

void PlainFile::resize(std::uint64_t size) {
    if (::ftruncate(file_.get(), static_cast<off_t>(size)) != 0) fail(named_, "written");
}

void PlainFile::sync() {
    if (::fsync(file_.get()) != 0) fail(named_, "written to disk");
}

bool PlainFile::stands() const { return !path_.empty() && stands_at(file_.get(), path_); }

bool PlainFile::lock() {
    int taken = 0;
    do {
        taken = ::flock(file_.get(), LOCK_EX | LOCK_NB);
    } while (taken != 0 && errno == EINTR);
    return taken == 0 || errno != EWOULDBLOCK;
}

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
    if (::stat(path.c_str(), &facts) != 0) fail(in_quotes(path), "read");
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

std::string file_begin(const std::string& path, std::size_t most) {
    std::string bytes(most, '\0');
    std::error_code none;
    if (!std::filesystem::is_regular_file(path, none)) return {};  // no waiting for a pipe's writer
    std::ifstream in(path, std::ios::binary);
    in.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    bytes.resize(static_cast<std::size_t>(in.gcount()));
    return bytes;
}

bool is_blank(std::string_view bytes) { return bytes.find_first_not_of('\0') == std::string_view::npos; }

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

void sync_directory(const std::string& path) {
    if (const int error = sync_folder(path)) fail(in_quotes(path), "written to disk", error);
}

void sync_file(const std::string& path) {
    const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
    if (!file) fail(in_quotes(path), "opened");
    if (::fsync(file.get()) != 0) fail(in_quotes(path), "written to disk");
}

void begin_sync(const std::string& path) noexcept {
    const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
    if (file) ::sync_file_range(file.get(), 0, 0, SYNC_FILE_RANGE_WRITE);
}

void rename_path(const std::string& from, const std::string& to) {
    if (std::rename(from.c_str(), to.c_str()) != 0) fail(in_quotes(to), "put in place");
}

}  // namespace wedgescope
