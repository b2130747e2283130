// Link budget: what one cell of the power image is made of, from the transmitter to the grey level.
// Leaves the words and units of the lines to tools/link_budget.cpp.
//
// A cell's echo is a sum over all the ground in its pulse and beam, so its factors are means over that ground, weighted
// with what each piece returns: found by sweeping the cell's azimuths again with one effect after another taken away.
// Each factor is the ratio of two such sweeps, so that their product is the cell's echo.
#pragma once
#include <vector>

#include "lib/engine.hpp"

namespace wedgescope {

/// A class of ground, or its walls, in a cell.
struct LinkPart {
    ClassId id = 0;
    bool wall = false;
    /// Seen through the beam's azimuth and the pulse (weights of peak 1), with the class' directivity.
    double cross_section_m2 = 0;
    /// Through the same weights: of ground the area of the visible surface (below least_area_grazing less), of walls what they
    /// show at right angles to the ray.
    double area_m2 = 0;
    /// sigma0, of walls gamma: what a unit of that returns.
    double sigma0() const { return area_m2 > 0 ? cross_section_m2 / area_m2 : 0; }
};

/// Ratios are linear, of powers, both ways; those of a cell without any echo are 1.
struct LinkBudget {
    std::int64_t azimuth_bin = 0, range_bin = 0;
    State state = State::unknown;  ///< of the ground in the cell itself; the beam and the pulse may bring more
    double azimuth_rad = 0;        ///< middle of the cell, clockwise from north of the geometry
    double range_m = 0;            ///< middle of the cell, as range bins count (ground range for gpi-true)
    double slant_range_m = 0;      ///< of that
    /// Of a level surface at the reference height and echo_range_m; none inside the altitude hole.
    std::optional<Angle> depression, grazing;

    double transmit_w = 0;
    double gain = 1;           ///< G_0^2
    double wavelength_m2 = 1;  ///< lambda^2 / (4 pi)^3
    double losses = 1;         ///< 1 / L_s
    double spreading_m4 = 1;   ///< mean of 1 / r^4 over the ground
    double echo_range_m = 0;   ///< the range of that; slant_range_m where there is no ground
    double cross_section_m2 =
        0;  ///< of all ground in it; the parts add up to it (but for the rounding of powers to quanta)
    std::vector<LinkPart> parts;  ///< all ground and walls in it, what returns most first
    double level_area_m2 =
        0;  ///< for comparison: the radar equation's cell on a level surface; 0: it ends in the altitude hole

    double far_shore = 1;  ///< what banks return more by way of the water before them; at least 1
    double pattern = 1;    ///< of elevation, g_el^2
    double gases = 1, rain = 1, cloud = 1;
    double echo_w = 0;       ///< of the ground: the product of all above
    double rain_echo_w = 0;  ///< of the rain itself
    double power_w = 0;      ///< of both: what the power layer holds
    double noise_w = 0;      ///< k T0 B F
    double received_w = 0;   ///< power and noise as drawn; 0 before the receiver opens
    double fluctuation = 1;  ///< received / (power + noise): of speckle and noise; 1 where both are off
    bool blanked = false;    ///< nearer than the minimum range

    double received_dbm = 0, mds_dbm = 0, stc_db = 0;
    Levels levels{};

    /// Product of transmitter to cloud.
    double product_w() const;
};

/// Of the cell of azimuth bin `azimuth_bin` and range bin `range_bin` of scene.shown (azimuths modulo the circle), which run()
/// makes of the same scene. Error where it holds no such cell; else as run(). Sweeps the beam's azimuths once over the scene's
/// range and then, to the cell, some five to ten times and twice for each class that is there.
LinkBudget link_budget(const ResolvedScene& scene, WedgeSource& source, const EngineParams& params,
                       std::int64_t azimuth_bin, std::int64_t range_bin);

/// Where a place on the ground lies: the cell that shows it, if nothing hides it.
struct CellPlace {
    double azimuth_rad = 0;  ///< clockwise from north of the geometry, 0 to 2 pi
    double range_m = 0;      ///< as range bins count
    double surface_m = 0;    ///< height of the surface there
};
/// Of a place on the grid whose surface the data base holds. InputError where it holds none.
CellPlace cell_place(const ResolvedScene& scene, WedgeSource& source, IndexPosition place);
/// And the place on a level surface at the reference height that the middle of a cell shows; nothing inside the altitude
/// hole. Latitude and longitude, degrees, where the raster has a CRS, else x and y.
std::optional<std::pair<double, double>> level_place(const ResolvedScene& scene, const DataBase& data_base,
                                                     double azimuth_rad, double range_m);

}  // namespace wedgescope
