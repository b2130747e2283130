// Descriptor: an open file or folder; and bytes read and written whole, whatever the system takes at a time.
// Leaves messages to whoever knows what the file is for: errors come back as numbers of errno.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

namespace wedgescope {

/// A file descriptor that closes itself.
class Descriptor {
public:
    explicit Descriptor(int number = -1) : number_(number) {}
    Descriptor(Descriptor&& other) noexcept;
    Descriptor& operator=(Descriptor&& other) noexcept;
    ~Descriptor();
    int get() const { return number_; }
    int release() { return std::exchange(number_, -1); }  ///< to be closed by the caller
    explicit operator bool() const { return number_ >= 0; }

private:
    int number_;
};

/// How much was done, and why not more: 0 if all was, or if the file that is read ends there.
struct Transfer {
    std::size_t bytes = 0;
    int error = 0;
};
Transfer write_all(int file, const void* from, std::size_t count) noexcept;
Transfer write_all_at(int file, const void* from, std::size_t count, std::uint64_t offset) noexcept;
Transfer read_all(int file, void* to, std::size_t count) noexcept;
Transfer read_all_at(int file, void* to, std::size_t count, std::uint64_t offset) noexcept;

/// Why a stream could not be written, whose user cleared errno before: what that says, or that the disk may be full.
std::string stream_reason();

/// Gives a file or folder another name if nothing stands there; else EEXIST.
int rename_new(const std::string& from, const std::string& to) noexcept;

/// Names in a folder to disk. 0 too on file systems that cannot: they are then as safe as they get.
int sync_folder(const std::string& path) noexcept;

}  // namespace wedgescope
