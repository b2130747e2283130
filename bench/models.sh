#!/usr/bin/env bash
# What each model costs beside constant gamma in clear air: a scene on shipped data, exact, one thread; all models by turns, the
# least CPU time of the rounds; then what `scope` takes to make the picture again from a stored echo image.
#   bench/models.sh [--rounds 5] [--program PATH]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

source bench/setup.sh
bench_setup "--rounds 5" "$@"

usual="--backscatter ulaby-dobson --sea-state 3 --polarisation vv --gases normal --rain heavy --cloud fog"
every="$usual --wind-direction 30deg --far-shore on"
models=(
    "--gases high" "--rain heavy" "--cloud fog"
    "--backscatter ulaby-dobson" "--backscatter oh" "--water calm" "--sea-state 3" "--sea-state 3 --wind-direction 30deg"
    "--far-shore on" "--walls statistical" "--class-table sides.csv" "--polarisation circular"
    "--speckle 1 --noise on" "--display gpi-true" "--bwe-scale 3 --ple-scale 3"
    "$usual" "$every" "$every --speckle 1 --noise on"
)
# Classes of one reflecting side, in the place of those that cover most of the scene.
printf '%s\n' 'name,directivity,axis_deg' 'shrub,uni,45' 'suburban,bi,0' >sides.csv

scene=("$program" simulate "$data/../../docs/scenes/f111a_northeast.ini" --quality exact --threads 1 --quiet --overwrite -o scope.png)
took() {  # command: CPU seconds
    "$tools/measure" figures "$@" >/dev/null
    awk '{ printf "%.3f\n", $2 + $3 }' figures
}
least() { sort -n "$1" | head -n 1; }

for ((round = 1; round <= rounds; ++round)); do
    took "${scene[@]}" >>plain
    for i in "${!models[@]}"; do
        read -ra options <<<"${models[i]}"
        took "${scene[@]}" "${options[@]}" >>"model_$i"
    done
done
base=$(least plain)
echo "| model | CPU, s | ratio |"
echo "| --- | --- | --- |"
echo "| constant gamma, clear air | $base | 1 |"
for i in "${!models[@]}"; do
    awk -v t="$(least "model_$i")" -v base="$base" -v m="${models[i]}" 'BEGIN { printf "| `%s` | %.2f | %.2f |\n", m, t, t / base }'
done

"${scene[@]}" --echo echo.tif
for ((round = 1; round <= rounds; ++round)); do
    took "$program" scope echo.tif --if-gain 47dB --quiet --overwrite -o again.png >>scope
    took "$program" --version >>start
    took gdalinfo --version >>gdalinfo
done
echo
echo "scope, another IF gain: $(least scope) s of CPU; of it to start the program $(least start) s (gdalinfo: $(least gdalinfo) s)"
