// Interval: a half-open run of integers [begin, end); Window: one of columns and one of rows.
// Leaves runs that wrap (azimuth) to arc.hpp.
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace wedgescope {

struct Interval {
    std::int64_t begin = 0;
    std::int64_t end = 0;  ///< one past the last; end <= begin is empty

    constexpr bool empty() const { return end <= begin; }
    constexpr std::int64_t size() const { return empty() ? 0 : end - begin; }
    constexpr bool contains(std::int64_t i) const { return i >= begin && i < end; }
    friend constexpr bool operator==(const Interval&, const Interval&) = default;
};

constexpr Interval intersection(Interval a, Interval b) { return {std::max(a.begin, b.begin), std::min(a.end, b.end)}; }

/// The least interval that holds both; an empty one adds nothing.
constexpr Interval hull(Interval a, Interval b) {
    if (a.empty()) return b;
    if (b.empty()) return a;
    return {std::min(a.begin, b.begin), std::max(a.end, b.end)};
}

struct Window {
    Interval columns;
    Interval rows;

    constexpr bool empty() const { return columns.empty() || rows.empty(); }
    constexpr std::int64_t posts() const { return columns.size() * rows.size(); }
    constexpr bool contains(std::int64_t column, std::int64_t row) const {
        return columns.contains(column) && rows.contains(row);
    }
    /// Where one that it contains lies, row after row.
    constexpr std::size_t at(std::int64_t column, std::int64_t row) const {
        return static_cast<std::size_t>((row - rows.begin) * columns.size() + column - columns.begin);
    }
    friend constexpr bool operator==(const Window&, const Window&) = default;

    friend constexpr Window intersection(const Window& a, const Window& b) {
        return {intersection(a.columns, b.columns), intersection(a.rows, b.rows)};
    }
    /// The least window that holds both; an empty one adds nothing.
    friend constexpr Window hull(const Window& a, const Window& b) {
        if (a.empty()) return b;
        if (b.empty()) return a;
        return {hull(a.columns, b.columns), hull(a.rows, b.rows)};
    }
};

}  // namespace wedgescope
