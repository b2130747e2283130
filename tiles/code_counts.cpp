#include "tiles/code_counts.hpp"

#include <algorithm>

namespace wedgescope {

std::size_t CodeCounts::bytes(std::int64_t cells, std::int64_t cell_bytes) {
    constexpr std::size_t node = 64;  // of the map, as the heap keeps it
    const std::size_t values = cell_bytes == 1 ? 256 : most_codes;
    return std::min(values, static_cast<std::size_t>(cells)) * node;
}

CodeCounts CodeCounts::of_too_many(std::uint64_t cells, std::int32_t least, std::int32_t greatest) {
    CodeCounts all;
    all.add_all(cells, least, greatest);
    all.forget();
    return all;
}

void CodeCounts::add_all(std::uint64_t cells, std::int32_t least, std::int32_t greatest) {
    cells_ += cells;
    least_ = std::min(least_, least);
    greatest_ = std::max(greatest_, greatest);
}

void CodeCounts::forget() {
    too_many_ = true;
    counts_.clear();
}

void CodeCounts::add(std::int32_t code, std::uint64_t cells) {
    if (cells == 0) return;
    add_all(cells, code, code);
    if (too_many_) return;
    counts_[code] += cells;
    if (counts_.size() > most_codes) forget();
}

void CodeCounts::add(const CodeCounts& other) {
    if (other.too_many_) {
        add_all(other.cells_, other.least_, other.greatest_);
        forget();
        return;
    }
    for (const auto& [code, cells] : other.counts_) add(code, cells);
}

}  // namespace wedgescope
