// Far shore: what a bank (or wall) behind water returns more by the ways over the water, as a spoke comes by both.
// Leaves the gain of one ray to sea.hpp and which pieces are seen, and of what class, to front.hpp.
//
// A point of the bank is lit by way of the water where the straight ray from the sensor to its image in the level of the
// water comes down on water that the sensor sees, and passes below the images of all land nearer than the point: then
// the ray that is thrown up reaches it over all that stands between. On a plane this is physics 5.3: water at the ground
// distance h_b / tan(psi) in front of a point h_b above it. Ground that the sensor does not see lies below a ray that
// falls, so it hides nothing from one that rises: only what is seen counts, and skipped ground changes nothing.
#pragma once
#include <array>
#include <limits>
#include <vector>

#include "lib/class_laws.hpp"

namespace wedgescope {

struct DataBase;
struct Scene;

/// Whether a scene asks for far shores over a data base that tells water from land: by culture alone.
bool lights_far_shores(const Scene& scene, const DataBase& data_base);

/// A point of a visible piece, as the sweep has it (sweep.hpp, SightLine).
struct ShorePoint {
    double sine = 0;  ///< of its elevation
    double up_m = 0, out_m = 0;
    double height_m = 0;
    double theta = 0;  ///< arc over the earth's radius
};

/// What a spoke keeps of the nearest water in front of it: a window, as the sensor sees it.
struct ShoreWindow {
    enum State { none, in_water, on_land };  ///< on_land: some was seen since the water
    State state = none;
    double from = 0,
           top = 0;  ///< sines of elevation: where the water begins; lowest of its end and of the images of land since
    double level_m = 0;  ///< of the water

    /// The window of a spoke between two: water and land that both have, as far as both have it.
    static ShoreWindow between(const ShoreWindow& a, const ShoreWindow& b);
};

class FarShore {
public:
    FarShore() = default;  ///< brightens nothing
    explicit FarShore(const ClassLawParams& params);

    /// The same classes on the same banks, brightened by nothing.
    FarShore without_gain() const;

    /// Asked for, and there are classes that tell water from land.
    bool on() const { return !entries_.empty(); }
    double most() const { return most_; }    ///< largest gain; 1 if it is off
    double error() const { return error_; }  ///< relative, of the table against far_shore_gain()
    bool is_water(ClassId id) const { return water_[id]; }
    /// far_shore_gain() of the sine of the grazing angle on the water.
    double gain(double sine) const noexcept;

    /// A piece of water from `a` out to `b`.
    static void pass_water(ShoreWindow& window, const ShorePoint& a, const ShorePoint& b) noexcept;
    /// Does land from `a` out to `b` leave a window as it is: no part of it is lit from there, nor hides another's light?
    static bool clear_of(const ShoreWindow& window, const ShorePoint& a, const ShorePoint& b) noexcept;
    /// A piece of land from `a` out to `b`: how many times it returns what it would by itself, the mean over the piece.
    double pass_land(ShoreWindow& window, const ShorePoint& a, const ShorePoint& b) const noexcept;

private:
    std::array<bool, std::size_t{std::numeric_limits<ClassId>::max()} + 1> water_{};  // by class
    std::vector<float> entries_;  // over the square root of the sine
    double most_ = 1, error_ = 0;
};

}  // namespace wedgescope
