// PolarGrid: which azimuth and range bins an image holds; PolarImage: one value for each of them.
// Leaves what the values mean to whoever fills them.
#pragma once
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <utility>

#include "lib/interval.hpp"
#include "lib/raw_vector.hpp"

namespace wedgescope {

/// Azimuth bins from `begin` on clockwise to `bin`: 0 <= result < circle_bins, wherever the two are counted from.
constexpr std::int64_t bins_after(std::int64_t bin, std::int64_t begin, std::int64_t circle_bins) {
    return ((bin - begin) % circle_bins + circle_bins) % circle_bins;
}

/// Middle of a bin of that width, bin 0 starting at 0.
constexpr double middle_of_bin(std::int64_t bin, double width) { return (static_cast<double>(bin) + 0.5) * width; }

/// Azimuth bin 0 starts at north of the geometry and bins go clockwise; range bin 0 starts at 0 m.
struct PolarGrid {
    std::int64_t circle_bins = 0;  ///< azimuth bins in the full circle
    double range_bin_m = 0;        ///< size of a range bin (slant range; ground range for gpi-true)
    Interval azimuth_bins;         ///< 0 <= begin < circle_bins; end may pass circle_bins (wraps through north)
    Interval range_bins;

    double azimuth_step_rad() const { return 2 * std::numbers::pi / static_cast<double>(circle_bins); }
    /// Middle of a range bin, and of an azimuth bin clockwise from north; bins by their number in the circle, not in the image.
    double range_m(std::int64_t range_bin) const { return middle_of_bin(range_bin, range_bin_m); }
    double azimuth_rad(std::int64_t azimuth_bin) const { return middle_of_bin(azimuth_bin, azimuth_step_rad()); }
    /// Middle of the range bin in a column of the image.
    double range_of_column_m(std::size_t column) const {
        return range_m(range_bins.begin + static_cast<std::int64_t>(column));
    }
    bool full_circle() const { return azimuth_bins.size() == circle_bins; }
    /// Of an azimuth bin (modulo the circle); azimuth_count() or more where the image does not hold it.
    std::size_t row_of(std::int64_t azimuth_bin) const {
        return static_cast<std::size_t>(bins_after(azimuth_bin, azimuth_bins.begin, circle_bins));
    }
    /// All of these azimuths (modulo the circle)?
    bool holds_azimuths(const Interval& bins) const {
        return full_circle() ||
               bins_after(bins.begin, azimuth_bins.begin, circle_bins) + bins.size() <= azimuth_bins.size();
    }
    std::size_t azimuth_count() const { return static_cast<std::size_t>(azimuth_bins.size()); }
    std::size_t range_count() const { return static_cast<std::size_t>(range_bins.size()); }
    std::size_t cells() const { return azimuth_count() * range_count(); }
    friend bool operator==(const PolarGrid&, const PolarGrid&) = default;
};

/// One row an azimuth bin (clockwise), one column a range bin (outwards), row after row.
template <class T>
struct PolarImage {
    PolarGrid grid;
    RawVector<T> cells;

    PolarImage() = default;
    explicit PolarImage(const PolarGrid& g) : grid(g), cells(g.cells(), T{}) {}
    /// In the memory that another image had, if it is large enough; what the cells hold is left as it may be, and who fills
    /// them is the first to touch them.
    PolarImage(const PolarGrid& g, PolarImage&& used) : grid(g), cells(std::move(used.cells)) {
        if (cells.capacity() < g.cells()) cells = {};  // before there is more, and nothing of it is copied
        cells.resize(g.cells());
    }
    /// By its number, as PolarGrid::row_of().
    T* row(std::size_t azimuth) { return cells.data() + azimuth * grid.range_count(); }
    const T* row(std::size_t azimuth) const { return cells.data() + azimuth * grid.range_count(); }
};

/// What a cell or a post is to the sensor; the codes of the state layer (design contract).
enum class State : std::uint8_t { no_data = 0, shadow = 1, seen = 2, unknown = 3, outside = 4 };
inline constexpr int state_count = 5;
inline constexpr const char* state_names[state_count] = {"no data", "shadow", "seen", "unknown", "outside"};

}  // namespace wedgescope
