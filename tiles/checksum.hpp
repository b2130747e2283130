// Checksums: XXH3 with 64 bits, to find damage and to tell one scene or data base from another, and how they are written
// in text. Leaves what is summed to each format.
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

/// The same of what comes in pieces.
class Checksum {
public:
    Checksum();
    ~Checksum();
    Checksum(const Checksum&) = delete;
    Checksum& operator=(const Checksum&) = delete;

    void add(const void* bytes, std::size_t count);
    void add(std::string_view bytes) { add(bytes.data(), bytes.size()); }
    void add(std::uint64_t number) { add(&number, sizeof number); }
    std::uint64_t value() const;

private:
    XXH3_state_t* state_;
};

/// 16 lower-case digits.
std::string hex(std::uint64_t sum);

/// Of a whole file, read piece by piece. IoError naming it.
std::uint64_t file_checksum(const std::string& path);

}  // namespace wedgescope
