// PlainFile: bytes of a file at a place, read and written whole or with an error that names the file.
// For the .cpp files of this folder only. Leaves formats to others.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "tiles/descriptor.hpp"

namespace wedgescope {

class PlainFile {
public:
    enum class Use { read, write };  ///< write: made if it is missing, never cut
    /// `becomes`: for messages, the name that it will have where that is another.
    PlainFile(std::string path, Use use, const std::string& becomes = {});
    struct Unnamed {
        std::string folder, what;  ///< what: for messages
    };
    /// Made in the folder without a name: gone with the process, however it ends.
    explicit PlainFile(const Unnamed& where);

    /// For messages: its path, or what it is and where.
    const std::string& named() const { return named_; }
    std::uint64_t bytes() const;
    /// IoError, also if the file ends before.
    void read(std::uint64_t at, void* out, std::size_t count) const;
    void write(std::uint64_t at, const void* from, std::size_t count);
    void resize(std::uint64_t bytes);
    void sync();
    /// False if another process holds the lock, which ends with the file's close. File systems that have none are forgiven.
    bool lock();
    /// Is it still this file that has the path?
    bool stands() const;

private:
    std::string path_;  ///< empty: it has none
    std::string named_;
    Descriptor file_;
};

/// Descriptor of a new file in a folder that has no name, for reading and writing; below 0 with errno.
int open_unnamed(const std::string& folder);

/// Bytes of a file; IoError naming it.
std::uint64_t file_bytes(const std::string& path);
/// All of a small file. DataError if it is larger than `most`.
std::string file_text(const std::string& path, std::size_t most);
/// Its first bytes, `most` or all; none of what cannot be read.
std::string file_begin(const std::string& path, std::size_t most);
/// Of nothing but zeros, or of nothing: so stands what never reached the disk.
bool is_blank(std::string_view bytes);
/// Writes `content` to `path` + ".tmp", syncs it and puts it in place. IoError.
void replace_file(const std::string& path, const std::string& content);
/// To disk; file systems that cannot sync folders are forgiven. IoError.
void sync_file(const std::string& path);
void sync_directory(const std::string& path);

/// Lets the system begin to write a file to disk while it is still read: a wish, sync_file() waits for the less.
void begin_sync(const std::string& path) noexcept;
void rename_path(const std::string& from, const std::string& to);

}  // namespace wedgescope
