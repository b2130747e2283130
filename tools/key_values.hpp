// Values of a form of their own, that one key has or two: places and sectors, legends and sets, an antenna by law or file,
// the tube's centre.
// Leaves kinds of values that many keys have to codec.hpp, and the keys to keys.hpp.
#pragma once
#include "tools/codec.hpp"

namespace wedgescope::codecs {

// ---- data base

/// By what it says, not by where it lies: an echo image and a work folder know the values.
Codec class_table();
Codec legend_choice();
Codec features_legend();
Codec material_choice();

// ---- places and looks

Codec latlon();
Codec xy();
/// Another place than the sensor's.
Codec other_place(std::optional<LatLon> Settings::*field);
Codec cell();
Codec altitude(AltitudeAbove above_what);
Codec sector();
Codec pitch();
Codec earth();

// ---- the set

/// Its values are no part of this: options.cpp gives each key that no one else gives.
Codec set_choice();
/// A law, or a file whose points are taken in at once: what is written of a run holds them, and no path.
Codec antenna_choice();
/// Chooses the quality too.
Codec max_error();
Codec seed();

// ---- the picture

/// A length, the time of a pulse's way there and back, or the sensor's height.
Codec sweep_delay();
Codec tube_centre();

// ---- the run

Codec only_wedge();
Codec config();
Codec creation();

}  // namespace wedgescope::codecs
