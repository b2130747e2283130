#include "lib/coverage_tiles.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>

namespace wedgescope {
namespace {

/// A buffer of `posts` that hold `value`, one of the spare ones if there are any.
template <class T>
std::vector<T> filled(std::vector<std::vector<T>>& spare, std::mutex& mutex, std::size_t posts, T value) {
    std::vector<T> buffer;
    {
        const std::lock_guard lock(mutex);
        if (!spare.empty()) {
            buffer = std::move(spare.back());
            spare.pop_back();
        }
    }
    buffer.assign(posts, value);
    return buffer;
}

}  // namespace

CoverageTiles::Tile& CoverageTiles::at(Key key) {
    std::unique_ptr<Tile>& tile = tiles_[key];
    if (!tile) {
        tile = std::make_unique<Tile>();
        tile->left = std::min(edge, rows_ - key.first * edge) * std::min(edge, columns_ - key.second * edge);
    }
    return *tile;
}

void CoverageTiles::known(Key key, std::int64_t posts) {
    if (posts == 0) return;
    Tile& tile = at(key);
    tile.left -= posts;
    if (tile.left < 0) throw std::logic_error("coverage: a post belongs to two quadrants");
    if (tile.left > 0) return;
    const auto place = tiles_.find(key);
    done_.push_back({key, std::move(place->second)});
    tiles_.erase(place);
}

void CoverageTiles::make(Tile& tile) {
    const auto posts = static_cast<std::size_t>(edge * edge);
    if (bytes_)
        tile.bytes = filled(spare_bytes_, spare_mutex_, posts, outside_);
    else
        tile.values = filled(spare_values_, spare_mutex_, posts, std::numeric_limits<float>::quiet_NaN());
}

template <class T>
const T* CoverageTiles::cells(Tile& tile, CoverageTile& out) {
    out.even = tile.bytes.empty() && tile.values.empty();
    return buffer<T>(out.even ? even_ : tile);
}

void CoverageTiles::hand_out(std::vector<Done> tiles, const std::function<void(const CoverageTile&)>& write) {
    for (auto& [key, tile] : tiles) {
        if (reached_only_ && tile->bytes.empty() && tile->values.empty()) continue;
        CoverageTile out;
        out.window = {{key.second * edge, std::min((key.second + 1) * edge, columns_)},
                      {key.first * edge, std::min((key.first + 1) * edge, rows_)}};
        out.stride = edge;
        if (bytes_)
            out.bytes = cells<std::uint8_t>(*tile, out);
        else
            out.values = cells<float>(*tile, out);
        write(out);
        if (out.even) continue;
        const std::lock_guard lock(spare_mutex_);
        if (bytes_)
            spare_bytes_.push_back(std::move(tile->bytes));
        else
            spare_values_.push_back(std::move(tile->values));
        tile.reset();
    }
}

}  // namespace wedgescope
