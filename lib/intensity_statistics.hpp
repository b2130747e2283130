// Intensity statistics: moments and tails of speckle and of K-distributed sea clutter, as closed forms.
// Leaves drawing them to fluctuation.hpp.
#pragma once
#include "lib/angle.hpp"
#include "lib/decibel.hpp"

namespace wedgescope {

/// Of 10 log10(I / mean), I the intensity of `looks` looks averaged: Gamma of shape N and mean 1.
struct SpeckleMoments {
    Decibel mean;             ///< (10 / ln 10) (digamma(N) - ln N): -2.507 dB for one look
    double deviation_db = 0;  ///< (10 / ln 10) sqrt(trigamma(N)): 5.570 dB for one look
};
/// `looks` above 0, also between whole numbers. InputError. Source: physics 10.
SpeckleMoments speckle_moments(double looks);

/// K distribution: I = mean X E, X of a Gamma distribution of shape nu and mean 1, E exponential of mean 1.
/// Shapes of 0.01 to 10 000: the larger, the nearer to an exponential. InputError. Source: physics 10.
/// The probability that I exceeds `ratio` (at least 0) times its mean: 2 / Gamma(nu) (nu t)^(nu/2) K_nu(2 sqrt(nu t)).
double k_distribution_exceedance(double shape, double ratio);
/// E[I^2] / E[I]^2 = 2 (1 + 1 / nu).
double k_distribution_second_moment(double shape);

/// What the shape of sea clutter takes the polarisation and the swell for.
struct SeaClutterCell {
    bool vertical = true;  ///< VV; else HH
    double area_m2 = 0;    ///< of the resolution cell, above 0
    Angle grazing{};       ///< 0.1 to 10 degrees
    bool swell = false;    ///< there is one
    Angle from_swell{};    ///< look direction minus the swell's
};
/// Shape nu at X band (Ward, Tough & Watts):
/// log10 nu = 2/3 log10(grazing in degrees) + 5/8 log10(area) - k - cos(2 from_swell) / 3, k 1.39 (VV), 2.09 (HH).
double sea_clutter_shape(const SeaClutterCell& cell);

}  // namespace wedgescope
