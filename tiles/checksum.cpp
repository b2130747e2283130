#include "tiles/checksum.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <new>
#include <vector>

#include "tiles/plain_file.hpp"

namespace wedgescope {

Checksum::Checksum() : state_(XXH3_createState()) {
    if (!state_) throw std::bad_alloc();
    XXH3_64bits_reset(state_);
}

Checksum::~Checksum() { XXH3_freeState(state_); }

void Checksum::add(const void* bytes, std::size_t count) { XXH3_64bits_update(state_, bytes, count); }

std::uint64_t Checksum::value() const { return XXH3_64bits_digest(state_); }

std::string hex(std::uint64_t sum) { return fmt::format("{:016x}", sum); }

std::uint64_t file_checksum(const std::string& path) {
    constexpr std::uint64_t piece = std::uint64_t{1} << 18;
    const PlainFile file(path, PlainFile::Use::read);
    const std::uint64_t size = file.bytes();
    std::vector<char> buffer(piece);
    Checksum sum;
    for (std::uint64_t at = 0; at < size; at += piece) {
        const auto n = static_cast<std::size_t>(std::min(size - at, piece));
        file.read(at, buffer.data(), n);
        sum.add(buffer.data(), n);
    }
    return sum.value();
}

}  // namespace wedgescope
