#!/usr/bin/env bash
# Makes the sheets of docs/gallery.md from shipped data: the scope pictures of the 1979 paper (Faintich, Digital Sensor
# Simulation), Figures 3 and 10 to 22, item by item. Figures 4 to 9 are projected optical views, which the program does not make yet.
#   docs/gallery/make.sh [PROGRAM [FOLDER]]     sheets go into docs/images/gallery, or into FOLDER
# Needs (Debian): apt-get install gdal-bin imagemagick
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
program=$(realpath "${1:-$here/../../build/release/tools/wedgescope}")
mkdir -p "${2:-$here/../images/gallery}"
sheets=$(realpath "${2:-$here/../images/gallery}")
data=$here/../../tests/data
scenes=$here/../scenes
for tool in gdalwarp gdal_translate gdaldem montage convert; do
  command -v $tool >/dev/null || { echo "make.sh: needs $tool: apt-get install gdal-bin imagemagick" >&2; exit 2; }
done
export GDAL_PAM_ENABLED=NO
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

# echo_of NAME SCENE.ini [options]: one sweep, kept as NAME.tif; tube NAME PICTURE [options]: a picture of it.
echo_of() { local name=$1; shift; "$program" simulate "$@" --echo "$name.tif" -q; }
tube() { local name=$1 picture=$2; shift 2; "$program" scope "$name.tif" --size 320 --rings "${rings:-off}" -q -o "$picture.png" "$@"; }

# cell=WxH: room for each, where their sizes differ.
# sheet NAME COLUMNS PICTURE LABEL [PICTURE LABEL ...]. 32 grey levels, so that all sheets together stay small.
sheet() {
  local name=$1 columns=$2 tiles=()
  shift 2
  while [ $# -gt 0 ]; do tiles+=(-label "$2" "$1.png"); shift 2; done
  montage "${tiles[@]}" -tile "${columns}x" -geometry "${cell:-}+4+2" -background white -pointsize 13 "$name.miff"
  convert "$name.miff" -colorspace Gray -dither None -posterize 32 -strip -define png:compression-level=9 "$sheets/$name.png"
  echo "$name.png"
}

# --- The data bases, thinned to the paper's densities: posts 400 ft apart with height steps of 25 ft, and 200 m with 35 ft.
# Culture and what stands there come from the same nearest cell, so that a height keeps its class.
# thin NAME POSTING_M STEP_M
thin() {
  gdalwarp -q -tr "$2" "$2" -r average -ot Float32 "$data/inland_empire_dem.tif" "$1_heights.tif"
  # Whole steps, and what a step is as the band's scale.
  gdal_translate -q -ot Int16 -scale 0 "$(awk "BEGIN { print 1000 * $3 }")" 0 1000 -a_scale "$3" -a_nodata none "$1_heights.tif" "$1_dem.tif"
  gdalwarp -q -tr "$2" "$2" -r near "$data/inland_empire_culture.tif" "$1_culture.tif"
  gdalwarp -q -tr "$2" "$2" -r near "$data/inland_empire_canopy.tif" "$1_canopy.tif"
  base=(--dem "$1_dem.tif" --culture "$1_culture.tif" --culture-height "$1_canopy.tif")
}
# Reflectivity as grey: gamma at 10 GHz of each class, -25 dB black to -5 dB white; water black.
cat >potential.txt <<'TABLE'
91 230 230 230
92 128 128 128
93 128 128 128
98 0 0 0
99 102 102 102
TABLE
for code in {101..109}; do echo "$code 115 115 115"; done >>potential.txt
for code in {121..149}; do echo "$code 128 128 128"; done >>potential.txt
for code in {161..189} {201..204}; do echo "$code 166 166 166"; done >>potential.txt

# drawn NAME POSTING_M STEP_M: heights (highest darkest), potential (most reflective brightest), shaded relief.
drawn() {
  gdal_translate -q -of PNG -ot Byte -scale 0 "$(awk "BEGIN { print 1734 / $3 }")" 255 0 -a_nodata none "$1_dem.tif" "$1_height.png"
  gdaldem color-relief -q -nearest_color_entry "$1_culture.tif" potential.txt "$1_potential.tif"
  gdal_translate -q -of PNG -b 1 "$1_potential.tif" "$1_potential.png"
  gdaldem hillshade -q -z "$(awk "BEGIN { print 2 * $3 }")" -compute_edges "$1_dem.tif" "$1_relief.tif"
  gdal_translate -q -of PNG "$1_relief.tif" "$1_relief.png"
}
thin coarse 200 10.668; coarse=("${base[@]}")
thin fine 121.92 7.62; fine=("${base[@]}")
drawn fine 121.92 7.62
drawn coarse 200 10.668
cell=320x320 sheet fig03_data_bases 3 fine_height '400 ft posts, 25 ft steps: heights' fine_potential '400 ft: reflectivity' fine_relief '400 ft: shaded relief' \
  coarse_height '200 m posts, 35 ft steps: heights' coarse_potential '200 m: reflectivity' coarse_relief '200 m: shaded relief'

# --- The three sweeps of the tube, from high up, so that slant and ground range differ.
echo_of high "$scenes/f111a_northeast.ini" "${fine[@]}" --latlon 33.86,-117.42 --altitude-msl 15000ft --range 8nmi
for display in gpi ppi tdppi; do rings=on tube high $display --display $display --if-gain 54dB; done
# Roads a nautical mile apart on level ground, as straight as can be, under the same aircraft: over a crossing, in the middle of a post.
x=453732.926 y=3740078.077
gdal_translate -q -ot Int16 -scale 0 10000 300 300 "$data/inland_empire_dem.tif" level.tif
awk -v x=$x -v y=$y '
  function road(x0, y0, x1, y1) {
    printf "%s{ \"type\": \"Feature\", \"properties\": { \"material\": \"metal\" },\n", comma
    printf "  \"geometry\": { \"type\": \"LineString\", \"coordinates\": [[%.3f, %.3f], [%.3f, %.3f]] } }", x0, y0, x1, y1
    comma = ",\n"
  }
  BEGIN {
    print "{ \"type\": \"FeatureCollection\", \"crs\": { \"type\": \"name\", \"properties\": { \"name\": \"urn:ogc:def:crs:EPSG::32611\" } },"
    print "\"features\": ["
    for (i = -9; i <= 9; ++i) {
      road(x + 1852 * i, y - 16668, x + 1852 * i, y + 16668)
      road(x - 16668, y + 1852 * i, x + 16668, y + 1852 * i)
    }
    print "] }"
  }' >roads.geojson
"$program" tile --features roads.geojson -q level.tif roads
# A road along a ray is thinner than a bin; spokes enough that it does not fade in steps.
echo_of crossing --set f111a --dem roads --xy $x,$y --geometry grid --altitude-msl 15000ft --range 8nmi --quality exact --spokes-per-post 4
tiles=()
for pair in 'gpi GPI' 'ppi PPI' 'tdppi TDPPI'; do
  display=${pair% *}
  tube crossing roads_$display --display $display --if-gain 50dB; tiles+=(roads_$display "${pair#* }, roads 1 nmi apart"); done
sheet fig10_displays 3 gpi GPI ppi PPI tdppi TDPPI "${tiles[@]}"

# --- Scan sectors.
echo_of ahead "$scenes/f111a_sector90.ini" --range 22nmi
tube ahead sector90; tube ahead sector60 --sector -30deg,30deg; tube ahead sector30 --sector -15deg,15deg
cell=320x320 sheet fig11_sectors 3 sector90 '90 degrees' sector60 '60 degrees' sector30 '30 degrees'

# --- Pixel fill and the set's own errors, on few cells of a coarse data base.
"$program" help simulate >help.txt
if grep -q -e --pixel-fill help.txt; then
  echo_of near "$scenes/f111a_sector90.ini" "${fine[@]}" --latlon 33.78,-117.44 --range 5nmi
  tube near unfiltered --pixel-fill none --bwe off --ple off
  tube near filled --pixel-fill holes --bwe off --ple off
  tube near wide --pixel-fill none --ple off
  tube near long --pixel-fill none --bwe off
  tube near filled_long --pixel-fill holes --bwe off
  tube near filled_both --pixel-fill holes
  # Exaggerated: a beam of three times the width gathers from farther outside the sector, so this is a sweep of its own.
  echo_of blurred "$scenes/f111a_sector90.ini" "${fine[@]}" --latlon 33.78,-117.44 --range 5nmi --bwe-scale 3 --ple-scale 3 --pixel-fill holes
  tube blurred three_wide --ple-scale 1; tube blurred three_long --bwe-scale 1; tube blurred three_both
  sheet fig12_errors 3 unfiltered 'unfiltered' filled 'PIXFIL' wide 'BWE' long 'PLE' filled_long 'PIXFIL + PLE' filled_both 'PIXFIL + BWE + PLE' \
    three_wide 'PIXFIL + 3 BWE + PLE' three_long 'PIXFIL + BWE + 3 PLE' three_both 'PIXFIL + 3 BWE + 3 PLE'
else
  echo "make.sh: $program has no key pixel-fill; fig12_errors is left as it is" >&2
fi

# --- Receiver: IF gain, then video gain.
tiles=(); for gain in 34 36 38 40 42 44; do tube ahead if$gain --if-gain ${gain}dB --video-gain 4dB; tiles+=(if$gain "IF gain $gain dB"); done
sheet fig13_if_gain 3 "${tiles[@]}"
tiles=(); for gain in 4 6 8 10 13 16; do tube ahead video$gain --if-gain 40dB --video-gain ${gain}dB; tiles+=(video$gain "video gain $gain dB, IF gain 40 dB"); done
sheet fig14_video_gain 3 "${tiles[@]}"

# --- Antenna patterns against IF gain; tilt, and the gain that nearly undoes it.
echo_of cosine "$scenes/f111a_sector90.ini" --range 22nmi --antenna cos-csc2 --antenna-exponent 1
tiles=()
for gain in 44 46 48 50; do tube ahead csc$gain --if-gain ${gain}dB --video-gain 4dB; tiles+=(csc$gain "CSC2, IF gain $gain dB"); done
for gain in 44 46 48 50; do tube cosine cos$gain --if-gain ${gain}dB --video-gain 4dB; tiles+=(cos$gain "COS-CSC2, IF gain $gain dB"); done
sheet fig15_antennas 4 "${tiles[@]}"
# A fan of 12 degrees: with the scene's own 6 degrees a tilt of 5 puts the far ground out of the beam.
for tilt in 0 5 10; do echo_of tilt$tilt "$scenes/f111a_sector90.ini" --range 22nmi --antenna-width 12deg --tilt ${tilt}deg; done
tiles=(); for pair in 0,42 5,42 10,42 0,50 5,50 10,60; do
  tilt=${pair%,*} gain=${pair#*,}
  tube tilt$tilt tilt_$pair --if-gain ${gain}dB --video-gain 4dB; tiles+=(tilt_$pair "CSC2, tilt $tilt deg, IF gain $gain dB"); done
# And a wide beam, which lights all of the scene's depressions much alike.
for tilt in 0 5 10; do
  echo_of fan$tilt "$scenes/f111a_sector90.ini" --range 22nmi --antenna gaussian --antenna-knee 10deg --antenna-width 40deg --tilt ${tilt}deg; done
for pair in 0,42 5,43 10,45; do
  tilt=${pair%,*} gain=${pair#*,}
  tube fan$tilt fan_$pair --if-gain ${gain}dB --video-gain 4dB; tiles+=(fan_$pair "wide beam, tilt $tilt deg, IF gain $gain dB"); done
sheet fig16_tilt 3 "${tiles[@]}"

# --- Weather: gases, then rain with circular polarisation.
tiles=(); for gases in none normal high; do
  echo_of gases_$gases "$scenes/f111a_sector90.ini" --range 28nmi --gases $gases
  tube gases_$gases air_$gases --if-gain 40dB; tiles+=(air_$gases "gases $gases, IF gain 40 dB"); done
sheet fig17_gases 3 "${tiles[@]}"
tiles=(); for rain in clear drizzle light moderate heavy excessive; do
  echo_of rain_$rain "$scenes/f111a_sector90.ini" --range 22nmi --rain $rain --polarisation circular
  tube rain_$rain wet_$rain; tiles+=(wet_$rain "rain $rain"); done
sheet fig18_rain 3 "${tiles[@]}"

# --- Sea states: Cape Flattery and the Strait of Juan de Fuca. The sea of this raster is its height 0; the rest is wooded.
gdal_translate -q -ot Byte -a_nodata none "$data/olympic_coast_dem.tif" coast.tif
{ echo 0,water; for code in {1..255}; do echo "$code,trees"; done; } >coast.csv
tiles=(); for state in 1 2 3 6; do
  echo_of sea$state "$scenes/f111a_northeast.ini" --dem "$data/olympic_coast_dem.tif" --culture coast.tif --culture-legend coast.csv \
    --culture-height coast.tif --culture-height-scale 0 --latlon 48.36,-124.55 --altitude-msl 5000ft --range 14nmi --sea-state $state
  tube sea$state waves$state --if-gain 64dB --video-gain 4dB; tiles+=(waves$state "sea state $state, IF gain 64 dB"); done
# Lake Mathews, in the sweeps that paper.md has its numbers from, cut out of large pictures: it is 14 km off.
# lake NAME PICTURE IF_GAIN_DB
lake() {
  "$program" scope "$1.tif" --size 2880 --rings off --overwrite -q -o large.png --if-gain "$3dB"
  convert large.png -crop 320x320+1252+1135 +repage "$2.png"
}
for pair in 0,off 0,on 6,off; do
  echo_of mathews_$pair "$scenes/f111a_sector90.ini" --geometry grid --range 22nmi --sea-state ${pair%,*} --far-shore ${pair#*,}; done
lake mathews_0,off calm 44; lake mathews_0,on bank 44; lake mathews_6,off rough 44; lake mathews_6,off rough_52 52
tiles+=(calm 'Lake Mathews, sea state 0, IF gain 44 dB' bank 'sea state 0, far-shore on, IF gain 44 dB'
  rough 'sea state 6, IF gain 44 dB' rough_52 'sea state 6, IF gain 52 dB')
# A lake between hills: dark water, and the far shore.
for shore in off on; do
  echo_of lake_$shore "$scenes/f111a_northeast.ini" --dem "$data/lake_sunapee_dem.tif" --culture "$data/lake_sunapee_culture.tif" --culture-legend nlcd \
    --culture-height "$data/lake_sunapee_culture.tif" --culture-height-scale 0 --latlon 43.38,-72.06 --altitude-msl 2500ft --range 4nmi --far-shore $shore
  tube lake_$shore shore_$shore --if-gain 28dB --video-gain 4dB; tiles+=(shore_$shore "Lake Sunapee, far-shore $shore, IF gain 28 dB")
done
sheet fig18_sea 4 "${tiles[@]}"

# --- Scenes as in Figures 19 to 22, on the 400 ft data base; the last row: one of them by density.
echo_of northeast "$scenes/f111a_northeast.ini" "${fine[@]}" --sector -60deg,60deg --range 22nmi
echo_of low "$scenes/f111a_ppi_2750ft.ini" "${fine[@]}" --sector -60deg,60deg
echo_of southeast "$scenes/f111a_northeast.ini" "${fine[@]}" --latlon 33.62,-117.28 --heading 315deg --sector -60deg,60deg --range 22nmi
echo_of east "$scenes/f111a_northeast.ini" "${fine[@]}" --latlon 33.80,-117.27 --altitude-msl 8000ft --heading 270deg --sector -60deg,60deg --range 22nmi
echo_of plain "$scenes/f111a_northeast.ini" --latlon 33.80,-117.27 --altitude-msl 8000ft --heading 270deg --sector -60deg,60deg --range 22nmi
echo_of sparse "$scenes/f111a_northeast.ini" "${coarse[@]}" --latlon 33.80,-117.27 --altitude-msl 8000ft --heading 270deg --sector -60deg,60deg --range 22nmi
# vertical NAME [options]: the data base seen from above in the frame of the scene's map: reflectivity, shaded by its relief.
vertical() {
  local name=$1; shift
  "$program" scope "$name.tif" --size 320 --rings off -q -o "$name.frame.tif" "$@"
  for part in potential relief; do
    gdal_translate -q -ot Byte -b 1 -scale 0 255 0 0 -a_nodata none "$name.frame.tif" part.tif
    gdal_translate -q -b 1 "fine_$part.tif" from.tif
    gdalwarp -q -r bilinear from.tif part.tif
    gdal_translate -q -of PNG part.tif "$part.png"
  done
  convert potential.png relief.png -compose multiply -composite -level 0,70% "above_$name.png"
}
tiles=()
for pair in 'northeast north-east, 7000 ft' 'low north-east, 2750 ft, PPI' 'southeast south-east, 7000 ft' 'east east, 8000 ft'; do
  name=${pair%% *}
  tube $name scene_$name
  if [ $name = low ]; then vertical low --display gpi; else vertical $name; fi
  tiles+=(scene_$name "${pair#* }" above_$name 'the same from above')
done
tube plain scene_plain; tube sparse scene_sparse
cell=320x320 sheet fig19_scenes 4 "${tiles[@]}" scene_plain 'east, 8000 ft: 30 m posts' scene_east 'east, 8000 ft: 400 ft posts' scene_sparse 'east, 8000 ft: 200 m posts'
du -cb "$sheets"/*.png | tail -1
