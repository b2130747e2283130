// Deposit: power -> azimuth and range cells of a wedge, as integer multiples of each range bin's quantum, so that no
// sum depends on order; and state marks, which are or-ed. Leaves what is deposited to shade.hpp and the image to the
// engine.
#pragma once
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "lib/interval.hpp"
#include "lib/polar.hpp"

namespace wedgescope {

/// One bit for each state that was met in a cell; outside is none of them.
enum StateBit : std::uint8_t { bit_no_data = 1, bit_shadow = 2, bit_unknown = 4, bit_seen = 8 };

/// What turns a deposit into a whole number: for each range bin, quantum = the least power of two >= B 2^-61, B the
/// most that a cell of the bin can hold: constant * most_pattern2 * 2 * azimuth_step * most_gamma / r^2, r the bin's
/// near edge, at least 1 m; in bins of ground range (gpi-true), round the nadir, how far all ground is known to be at the least.
struct Quanta {
    Interval range_bins;
    std::vector<double> watts;    ///< of one quantum
    std::vector<double> inverse;  ///< exactly 1 / watts
    std::vector<Interval> runs;   ///< of range bins with one quantum, in order
};
/// No ground within a reach of the nadir, along the ground, is nearer.
struct NearestGround {
    double reach_m = 0, range_m = 1;
};
Quanta quanta(Interval range_bins, double range_bin_m, double radar_constant, double most_pattern2,
              double azimuth_step_rad, double most_gamma, const NearestGround& below = {});

/// Cells of one wedge: `rows` azimuth bins x range bins. Further channels (sum of power times a quantity in 0..1) lie
/// behind one another, each a full set of cells with the same quanta. In halves, every other spoke adds to rows of its own:
/// what each half alone makes of a cell tells how well it was sampled.
class WedgeCells {
public:
    enum class Halves : std::size_t { together = 1, apart = 2 };
    WedgeCells(std::size_t rows, const Quanta& quanta, std::size_t channels = 1, Halves halves = Halves::together);

    std::size_t rows() const { return rows_; }
    std::size_t columns() const { return columns_; }
    std::size_t bytes() const { return bytes_of(rows_, columns_, channels_, halves_); }
    static std::size_t bytes_of(std::size_t rows, std::size_t columns, std::size_t channels = 1,
                                Halves halves = Halves::together) {
        const std::size_t sums = channels * static_cast<std::size_t>(halves);
        return rows * columns * (sums * sizeof(std::int64_t) + 1) + rows * bit_count * sizeof(Marked);
    }

    /// An azimuth share of a spoke: rows `row` and `row + 1` take `share[0]` and `share[1]` (radians; 0: not this one).
    /// `row` is row_of(azimuth bin, spoke).
    struct Target {
        std::int32_t row = 0;
        double share[2] = {0, 0};
    };

    /// Where spoke number k puts what falls into an azimuth bin.
    std::int32_t row_of(std::int64_t bin, std::int64_t k) const {
        return static_cast<std::int32_t>(bin +
                                         (halves_ == Halves::apart && (k & 1) ? static_cast<std::int64_t>(rows_) : 0));
    }

    /// Power of one visible piece and how it lies in range.
    struct Portion {
        double x0, x1;  ///< range coordinate of its ends, in bins from range 0; either may be the nearer
        double power;   ///< W per radian of azimuth, with backscatter 1
        double bow;     ///< up to part u of the way lies the share u + bow u (1 - u); -1..1
    };
    /// Its backscatter: gamma[0] up to part `second` of the way from x0 to x1, gamma[1] from there up to part `third`,
    /// gamma[2] from there on; 0 <= second <= third <= 1.
    struct Stretches {
        float gamma[3];
        float second, third;
        static Stretches one(double gamma) {
            const auto g = static_cast<float>(gamma);
            return {{g, g, g}, 0, 0};
        }
    };
    /// Adds it to the cells. `quantities`: one for each further channel. Where in its first bin it begins and its way from
    /// there are floats; so is what falls into each bin, of its power, if these are three at the most.
    void add(const Target& target, const Portion& p, const Stretches& stretches, const double* quantities = nullptr);

    /// Many portions at once: `add` for every one, the same bits.
    ///   origin                where a spoke's row lies: origin_of(row); any row's, with share0 = 0, if it adds nothing
    ///   share0, share1        as Target::share
    ///   straddlers            lanes with share1 > 0
    ///   x0, x1                times `bins` as Portion
    ///   power, bow            as Portion
    ///   gamma, second, third  as Stretches, finite; no `second`: gamma[2] all along, and the others are not looked at.
    ///                         Lanes with gamma[2] < 0 add nothing
    /// The first n are finite.
    /// All but `origin` and `straddlers` go on to whole_registers(n), with anything.
    struct Portions {
        static constexpr std::size_t most = 128;  ///< lanes at once
        const std::int64_t* origin;
        const double *share0, *share1;
        std::span<const std::int32_t> straddlers;
        const double *x0, *x1;
        double bins;
        const double* power;
        const float* bow;
        const float* gamma[3];
        const float *second = nullptr, *third = nullptr;
    };
    std::int64_t origin_of(std::int32_t row) const {
        return static_cast<std::int64_t>(row) * static_cast<std::int64_t>(columns_) -
               static_cast<std::int64_t>(first_bin_);
    }
    void add_lanes(std::size_t n, const Portions& portions);

    /// Marks the bins from x0 to x1.
    void mark(const Target& target, double x0, double x1, std::uint8_t bit);

    double watts(std::size_t row, std::size_t column, std::size_t channel = 0) const {
        const std::int64_t* const cell = sums_.data() + (channel * all_rows() + row) * columns_ + column;
        return static_cast<double>(cell[0] + (halves_ == Halves::apart ? cell[rows_ * columns_] : 0)) *
               quanta_.watts[column];
    }
    bool apart() const { return halves_ == Halves::apart; }
    /// Watts of the first channel that each half put into a row.
    void halves(std::size_t row, float* even, float* odd) const;
    /// As if nothing had been added to these rows.
    void clear(Interval rows);
    /// All of a row: watts of the first channel, and states (codes of State), the most telling of those met: seen, unknown,
    /// shadow, no data; outside where nothing fell.
    void finish(std::size_t row, float* watts, std::uint8_t* states) const;

private:
    std::size_t all_rows() const { return rows_ * static_cast<std::size_t>(halves_); }
    std::int32_t row_of_origin(std::int64_t origin) const {
        return static_cast<std::int32_t>((origin + static_cast<std::int64_t>(first_bin_)) /
                                         static_cast<std::int64_t>(columns_));
    }
    struct Placing;
    /// A share of the power, with backscatter.
    void put(const Target& target, std::int32_t bin, double power, double part, const double* quantities) {
        const std::size_t j = static_cast<std::size_t>(bin) - first_bin_;
        const double whole = power * quanta_.inverse[j];
        std::int64_t* cell = sums_.data() + static_cast<std::size_t>(target.row) * columns_ + j;
        *cell += std::lrint(part * (whole * target.share[0]));
        if (target.share[1] > 0) cell[columns_] += std::lrint(part * (whole * target.share[1]));
        if (channels_ > 1) put_quantities(target, j, whole * part, quantities);
    }
    void put_quantities(const Target& target, std::size_t column, double whole, const double* quantities);
    void add_placed(const Target& target, const Placing& placing, double power, const Stretches& stretches,
                    const double* quantities);
    template <class Real>
    void spread(const Target& target, const Placing& placing, std::int32_t bins, double power,
                const Stretches& stretches, const double* quantities);
    void add_cut(const Target& target, const Placing& placing, double power, const Stretches& stretches,
                 const double* quantities);

    const Quanta& quanta_;
    std::size_t rows_, columns_, channels_, first_bin_;
    Halves halves_;
    std::vector<std::int64_t> sums_;
    std::vector<std::uint8_t> bits_;
    /// For each row and bit a stretch of columns that have it all: neighbouring spokes lie in the same shadow.
    static constexpr std::size_t bit_count = 4;
    struct Marked {
        std::size_t begin = 0, end = 0;
    };
    std::vector<Marked> marked_;
};

}  // namespace wedgescope
