#include "tiles/checksum.hpp"

#include <new>

namespace wedgescope {

Checksum::Checksum() : state_(XXH3_createState()) {
    if (!state_) throw std::bad_alloc();
    XXH3_64bits_reset(state_);
}

Checksum::~Checksum() { XXH3_freeState(state_); }

void Checksum::add(const void* bytes, std::size_t count) { XXH3_64bits_update(state_, bytes, count); }

std::uint64_t Checksum::value() const { return XXH3_64bits_digest(state_); }

}  // namespace wedgescope
