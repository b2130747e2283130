#include "tiles/tile_cache.hpp"

#include <iterator>

namespace wedgescope {

TileCache::Tile TileCache::find(const Key& key) {
    const std::lock_guard lock(mutex_);
    const auto place = places_.find(key);
    if (place == places_.end()) return nullptr;
    recent_.splice(recent_.begin(), recent_, place->second);
    return place->second->second;
}

void TileCache::add(const Key& key, Tile tile) {
    std::list<Entry> gone;  // freed behind the lock
    const std::lock_guard lock(mutex_);
    if (bytes_of(tile) > most_ || places_.contains(key)) return;
    held_ += bytes_of(tile);
    recent_.emplace_front(key, std::move(tile));
    places_[key] = recent_.begin();
    drop(gone);
}

void TileCache::limit(std::size_t most_bytes) {
    std::list<Entry> gone;
    const std::lock_guard lock(mutex_);
    most_ = most_bytes;
    drop(gone);
}

void TileCache::drop(std::list<Entry>& gone) {
    while (held_ > most_) {
        held_ -= bytes_of(recent_.back().second);
        places_.erase(recent_.back().first);
        gone.splice(gone.begin(), recent_, std::prev(recent_.end()));
    }
}

}  // namespace wedgescope
