// Checksums: XXH3 with 64 bits, as the store's files carry them, and how they are written in text.
// For the .cpp files of this folder only. Leaves what is summed to each format.
#pragma once
#include <xxhash.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace wedgescope {

inline std::uint64_t checksum(const void* bytes, std::size_t count, std::uint64_t seed = 0) {
    return XXH3_64bits_withSeed(bytes, count, seed);
}
inline std::uint64_t checksum(std::string_view bytes) { return checksum(bytes.data(), bytes.size()); }

/// 16 lower-case digits.
std::string hex(std::uint64_t sum);

/// Of a whole file, read piece by piece. IoError naming it.
std::uint64_t file_checksum(const std::string& path);

}  // namespace wedgescope
