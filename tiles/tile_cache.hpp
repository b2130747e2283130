// TileCache: tiles that were decoded here, shared by all layers of a source that read their tiles without GDAL, and classes of
// whole tiles of its culture, whoever read that.
// For the .cpp files of this folder only. Leaves decoding to tile_decoder.hpp, and files that GDAL decodes to its own cache.
#pragma once
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <utility>

#include "lib/raw_vector.hpp"

namespace wedgescope {

/// Of what a session grants for decoded blocks: a quarter is left to GDAL, for layers that it reads and for what is written.
inline std::size_t tile_cache_share(std::size_t cache_bytes) { return cache_bytes / 4 * 3; }

/// Decoded tiles by layer and number; the ones not used for longest go when it is full.
class TileCache {
public:
    using Tile = std::shared_ptr<const RawVector<std::byte>>;
    using Key = std::pair<int, std::uint64_t>;

    explicit TileCache(std::size_t most_bytes) : most_(most_bytes) {}
    Tile find(const Key& key);
    void add(const Key& key, Tile tile);
    /// The first number of a new layer's keys for its level 0; level k, below 32, has the k-th behind it.
    int new_layer() { return 32 * next_layer_++; }
    /// What a tile takes beside its values, about.
    static constexpr std::size_t entry_bytes = 256;
    /// From now on at most so much.
    void limit(std::size_t most_bytes);
    std::size_t most_bytes() {
        const std::lock_guard lock(mutex_);
        return most_;
    }
    /// Has it room for sixteen tiles of that size? Else one may have to be unpacked for each window of it.
    bool keeps(std::size_t tile_bytes) { return tile_bytes <= most_bytes() / 16; }
    /// Held just now.
    std::size_t bytes() {
        const std::lock_guard lock(mutex_);
        return held_;
    }

private:
    using Entry = std::pair<Key, Tile>;
    void drop(std::list<Entry>& gone);

    std::mutex mutex_;
    std::size_t most_;
    static std::size_t bytes_of(const Tile& tile) { return tile->size() + entry_bytes; }

    std::list<Entry> recent_;  ///< the last used in front
    std::map<Key, std::list<Entry>::iterator> places_;
    std::size_t held_ = 0;
    std::atomic<int> next_layer_{0};
};

}  // namespace wedgescope
