// Class laws: what every class of ground and its walls return in one scene, as the sweep looks it up.
// Leaves the laws to backscatter.hpp and sea.hpp and which class follows which to material.hpp.
#pragma once
#include <cstdint>
#include <optional>
#include <vector>

#include "lib/decibel.hpp"
#include "lib/material.hpp"
#include "lib/polarisation.hpp"
#include "lib/rounding.hpp"
#include "lib/sea.hpp"

namespace wedgescope {

/// The model of water: `nrl` sea_nrl_law of the sea state, `calm` sea_calm_law (the mirror of inland water alone).
enum class WaterModel { nrl, calm };

/// What of a class' walls: those that culture heights make, or of a class with Structures, their mean (physics 7.3).
enum class Walls { resolved, statistical };

struct ClassLawParams {
    Materials materials{};  ///< the classes
    double frequency_hz = 10e9;
    Polarisation polarisation = Polarisation::hh;
    LandModel land = LandModel::constant_gamma;
    WaterModel water = WaterModel::nrl;
    double sea_state = 0;
    std::optional<Decibel> gamma{};  ///< one constant gamma at 10 GHz in place of every law, walls and water included
    std::optional<Angle>
        wind_from{};         ///< azimuth that the wind blows from; none: the sea is the mean over wind directions
    bool far_shore = false;  ///< FarShore (far_shore.hpp)
    Walls walls = Walls::resolved;
};
/// Of the class of water, which has no gamma.
inline bool is_of_water(const Material& material) { return !material.gamma10_db; }
/// The law of a class' ground: ground_law of land, the water model of water (a class without a gamma); with statistical walls
/// gamma_w n H w cos psi of its structures more, if no one gamma is for everything. InputError where a model does not reach
/// the frequency or the sea state.
BackscatterLaw class_law(const Material& material, const ClassLawParams& params);
/// Without making any table: may ClassLaws of these be none but constant()? May they be directional()?
bool may_need_facets(const ClassLawParams& params);
bool may_be_directional(const ClassLawParams& params);
/// Do these have waves, and a direction that the wind blows from?
bool may_be_windy(const ClassLawParams& params);
/// What circular polarisation (of one sense both ways) takes of a constant gamma: 3 dB of ground, 0.5 dB of walls, which
/// return by two bounces [P] (physics "Rain volume echo").
inline constexpr Decibel circular_loss{3}, circular_wall_loss{0.5};

/// Down to it areas are known to 0.01 dB; a level surface is met so flat from a metre up at 57 km.
inline constexpr Angle least_area_grazing = Angle::degrees(0.001);

/// Factors sigma0 / sin(grazing) of each class: constants, or tables over law_variable() of the local grazing angle.
class ClassLaws {
public:
    ClassLaws() = default;
    explicit ClassLaws(const ClassLawParams& params);
    /// Of constant gammas alone, by class.
    explicit ClassLaws(std::vector<ClassGamma> gamma);
    /// Factors of these laws for the ground and the walls of some classes, the others return nothing; most() stays. Both as
    /// many as there are classes.
    ClassLaws only(const std::vector<bool>& ground, const std::vector<bool>& walls) const;
    /// The ground of these classes returns its area, sigma0 = 1 (below `least_area_grazing` less), their walls the area
    /// that they show, gamma = 1; the others return nothing. Both as many as there are classes.
    static ClassLaws areas(const std::vector<bool>& ground, const std::vector<bool>& walls);

    /// No class depends on the angle: gamma() is all there is.
    bool constant() const { return entries_.empty(); }
    /// By class; `ground` of a class with a table is its largest factor.
    const std::vector<ClassGamma>& gamma() const { return gamma_; }
    double most() const { return most_; }          ///< largest factor of ground and walls
    double error_db() const { return error_db_; }  ///< of the tables, see BackscatterTable
    /// By how much the sine of the incidence may change over ground that is taken at one angle: four tenths of the width of the
    /// narrowest lobe that a law has round the vertical; infinite where none falls to 1/e within a quarter.
    double most_turn() const { return most_turn_; }

    double ground(ClassId id, double variable) const noexcept {
        if (entries_.empty()) return gamma_[id].ground;
        const Row& row = rows_[id];
        const double reached = (variable - row.begin) * row.scale, place = reached > 0 ? reached : 0.0;
        const int whole = static_cast<int>(place), i = whole < row.last ? whole : row.last;
        const double* const entry = entries_.data() + row.first + i;
        return entry[0] + (place - i) * (entry[1] - entry[0]);
    }
    double wall(ClassId id) const noexcept { return gamma_[id].wall; }

    /// Some class returns more to one side than to another.
    bool directional() const { return !facings_.empty(); }
    // The same towards a sensor from which the place lies in the azimuth of this sine and cosine (clockwise from north; there
    // and back differ by half a turn, what meridians converge by within the range aside [P]), where some class is directional.
    double ground(ClassId id, double variable, double sine, double cosine) const noexcept {
        const double factor = ground(id, variable) * facing_gain(id, sine, cosine);
        return windy_ && facings_[id].waves ? factor * wind_.at(variable, cosine * upwind_north_ + sine * upwind_east_)
                                            : factor;
    }
    double wall(ClassId id, double sine, double cosine) const noexcept {
        return wall(id) * facing_gain(id, sine, cosine);
    }

private:
    /// directivity_gain().
    double facing_gain(ClassId id, double sine, double cosine) const noexcept {
        const Facing& facing = facings_[id];
        if (facing.directivity == Directivity::omni) return 1;
        const double towards = -(cosine * facing.north + sine * facing.east),
                     shown = facing.directivity == Directivity::bi || towards > 0 ? towards : 0, square = shown * shown;
        static_assert(directivity_exponent == 4);
        return square * square > least_directivity ? square * square : least_directivity;
    }

    struct Row {
        std::size_t first;
        int last;  // interval
        double begin, scale;
    };
    /// Of the outward normal.
    struct Facing {
        Directivity directivity;
        double east, north;
        bool waves;  // its ground is a sea
    };
    /// Tables or constants, a row a class; those of water under the wind.
    void keep(const std::vector<BackscatterTable>& tables, const std::vector<bool>& water);

    std::vector<ClassGamma> gamma_;
    std::vector<Facing> facings_;  // empty: all are omni
    std::vector<Row> rows_;
    std::vector<double> entries_;
    bool windy_ = false;
    WindTable wind_;
    double upwind_east_ = 0, upwind_north_ = 0;
    double most_ = 0, error_db_ = 0, most_turn_ = infinite;
};

}  // namespace wedgescope
