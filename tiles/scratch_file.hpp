// ScratchFile: a file without a name for what does not fit into memory: gone with the process, however it ends.
// Leaves what lies where in it to others.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "tiles/claim.hpp"

namespace wedgescope {

class ScratchFile {
public:
    /// `folder`: empty: temporary_folder(). `what`: for messages ("the counts of observers").
    ScratchFile(std::string folder, std::string what);

    /// From any thread. IoError naming the folder (disk full, a folder that cannot be written to, ...). The first write opens
    /// the file; so does open(), to find a bad folder before any work.
    void open();
    void write(std::span<const std::byte> bytes, std::uint64_t offset);
    void read(std::span<std::byte> into, std::uint64_t offset) const;

private:
    [[noreturn]] void fail(const char* what, int reason) const;
    std::string folder_, what_;
    Descriptor file_;
};

}  // namespace wedgescope
