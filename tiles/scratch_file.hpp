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
    /// `folder`: empty: temporary_folder(). For messages `what` ("the counts of observers"), and what the folder was given as.
    ScratchFile(std::string folder, std::string what, std::string given_as = "temp-dir");

    /// From any thread. IoError naming the folder (disk full, a folder that cannot be written to, ...). The first write opens
    /// the file; so does open(), to find a bad folder before any work.
    void open();
    void write(std::span<const std::byte> bytes, std::uint64_t offset);
    void read(std::span<std::byte> into, std::uint64_t offset) const;

private:
    [[noreturn]] void fail(const char* what, int reason) const;
    std::string folder_, what_, given_as_;
    Descriptor file_;
};

}  // namespace wedgescope
