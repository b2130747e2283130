#!/usr/bin/env bash
# Makes the README's two pictures: the scope of f111a_sector90.ini to 22 nmi, north up, and the terrain's shaded relief in the same frame.
#   docs/images/make.sh [PROGRAM]      (needs gdal-bin)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
program=${1:-../../build/release/tools/wedgescope}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

scene=(simulate ../scenes/f111a_sector90.ini --range 22nmi --orientation north --size 640 --quiet --overwrite)
"$program" "${scene[@]}" --rings off --output "$work/scope.tif"
"$program" "${scene[@]}" --output "$work/scope.png"
gdal_translate -q -of PNG --config GDAL_PAM_ENABLED NO "$work/scope.png" scope.png

# The relief onto the picture's own frame: a copy of the picture that the relief is burned into.
gdaldem hillshade -q -z 2 -compute_edges ../../tests/data/inland_empire_dem.tif "$work/relief.tif"
gdal_translate -q -ot Byte -scale 0 255 0 0 -a_nodata none "$work/scope.tif" "$work/frame.tif"
gdalwarp -q -r average "$work/relief.tif" "$work/frame.tif"
gdal_translate -q -of PNG --config GDAL_PAM_ENABLED NO "$work/frame.tif" terrain.png
