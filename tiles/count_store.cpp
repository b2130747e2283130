#include "tiles/count_store.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "lib/error.hpp"
#include "tiles/checksum.hpp"

namespace wedgescope {
namespace {

std::size_t tiles_along(std::int64_t posts) {
    return static_cast<std::size_t>((posts + CountStore::edge - 1) / CountStore::edge);
}

}  // namespace

CountStore::CountStore(std::int64_t columns, std::int64_t rows, std::size_t observers, std::size_t memory_bytes,
                       const std::string& temp_folder)
    : tiles_across_(static_cast<std::int64_t>(tiles_along(columns))), wide_(observers > most_observers_in_byte),
      tile_bytes_(tile_bytes(observers)), most_tiles_(std::max<std::size_t>(2, memory_bytes / tile_bytes_)),
      file_(temp_folder, "the file for counts of observers"), slots_(tiles_along(columns) * tiles_along(rows)) {
    if (most_tiles_ < slots_.size()) file_.open();
}

std::size_t CountStore::tile_bytes(std::size_t observers) {
    return static_cast<std::size_t>(edge * edge) * (observers > most_observers_in_byte ? 2 : 1);
}

std::size_t CountStore::index_bytes(std::int64_t columns, std::int64_t rows) {
    return tiles_along(columns) * tiles_along(rows) * (sizeof(Slot) + sizeof(std::size_t));
}

std::size_t CountStore::all_bytes(std::int64_t columns, std::int64_t rows, std::size_t observers) {
    return tiles_along(columns) * tiles_along(rows) * tile_bytes(observers);
}

/// Cells for one tile more, whatever they hold.
std::unique_ptr<std::byte[]> CountStore::room(std::unique_lock<std::mutex>& lock) {
    for (;;) {
        if (held_ < most_tiles_) {
            std::unique_ptr<std::byte[]> cells(new std::byte[tile_bytes_]);
            ++held_;
            return cells;
        }
        random_ = random_ * 6364136223846793005ULL + 1442695040888963407ULL;
        const std::size_t n = resident_.size(), first = n > 0 ? (random_ >> 33) % n : 0;
        for (std::size_t i = 0; i < n; ++i) {
            const std::size_t place = (first + i) % n, at = resident_[place];
            if (slots_[at].busy) continue;
            slots_[at].busy = true;
            std::swap(resident_[place], resident_.back());
            resident_.pop_back();
            lock.unlock();
            const std::span<const std::byte> cells(slots_[at].cells.get(), tile_bytes_);
            const std::uint64_t sum = checksum(cells.data(), cells.size());
            try {
                file_.write(cells, at * tile_bytes_);
            } catch (...) {
                lock.lock();
                resident_.push_back(at);
                let_go(at);
                throw;
            }
            lock.lock();
            written_ += tile_bytes_;
            slots_[at].sum = sum;
            slots_[at].in_file = true;
            auto free = std::move(slots_[at].cells);
            let_go(at);
            return free;
        }
        changed_.wait(lock);
    }
}

/// While the mutex is held.
void CountStore::let_go(std::size_t at) {
    slots_[at].busy = false;
    changed_.notify_all();
}

/// What was written of a tile; zeros if nothing was.
void CountStore::fetch(std::size_t at, std::byte* cells) const {
    if (!slots_[at].in_file) {
        std::memset(cells, 0, tile_bytes_);
        return;
    }
    file_.read({cells, tile_bytes_}, at * tile_bytes_);
    if (checksum(cells, tile_bytes_) != slots_[at].sum)
        throw DataError(text("the file for counts of observers is damaged: tile at column ",
                             static_cast<std::int64_t>(at) % tiles_across_ * edge, ", row ",
                             static_cast<std::int64_t>(at) / tiles_across_ * edge, " does not hold what was written"));
}

void CountStore::add(const CoverageTile& mask) {
    const auto at =
        static_cast<std::size_t>(mask.window.rows.begin / edge * tiles_across_ + mask.window.columns.begin / edge);
    std::unique_lock lock(mutex_);
    Slot& slot = slots_[at];
    changed_.wait(lock, [&] { return !slot.busy; });
    slot.busy = true;
    std::unique_ptr<std::byte[]> fresh;
    try {
        if (!slot.cells) fresh = room(lock);
        lock.unlock();
        if (fresh) fetch(at, fresh.get());
    } catch (...) {
        if (!lock.owns_lock()) lock.lock();
        if (fresh) --held_;
        let_go(at);
        throw;
    }
    std::byte* const cells = fresh ? fresh.get() : slot.cells.get();
    const auto width = static_cast<std::size_t>(mask.window.columns.size());
    for (std::int64_t r = 0; r < mask.window.rows.size(); ++r) {
        const std::uint8_t* const codes = mask.bytes + r * mask.stride;
        if (wide_)
            add_observer(codes, width, reinterpret_cast<std::uint16_t*>(cells) + r * edge);
        else
            add_observer(codes, width, reinterpret_cast<std::uint8_t*>(cells) + r * edge);
    }
    lock.lock();
    if (fresh) {
        if (slot.in_file) read_ += tile_bytes_;
        slot.cells = std::move(fresh);
        resident_.push_back(at);
    }
    let_go(at);
}

bool CountStore::take(std::int64_t column, std::int64_t row, std::span<std::uint16_t> numbers) {
    const auto at = static_cast<std::size_t>(row * tiles_across_ + column);
    Slot& slot = slots_[at];
    if (!slot.cells && !slot.in_file) return false;
    std::unique_ptr<std::byte[]> cells = std::move(slot.cells);
    if (!cells) {
        cells.reset(new std::byte[tile_bytes_]);
        fetch(at, cells.get());
        read_ += tile_bytes_;
    }
    constexpr auto posts = static_cast<std::size_t>(edge * edge);
    if (wide_) {
        std::memcpy(numbers.data(), cells.get(), posts * sizeof(std::uint16_t));
    } else {
        const auto* bytes = reinterpret_cast<const std::uint8_t*>(cells.get());
        std::copy(bytes, bytes + posts, numbers.begin());
    }
    return true;
}

}  // namespace wedgescope
