#!/usr/bin/env bash
# One data base far larger than memory: `tile`, `coverage` and `simulate` of it in little memory, cold (nothing of it in the
# system's cache) and warm: wall and CPU seconds, peak memory, bytes of the data base read and million posts a second.
#   bench/huge.sh [--posts 104000] [--heights "500 3000"] [--range 0] [--memory 256MiB] [--folder PATH] [--program PATH]
# Mountains (make_terrain ridged), int16, 30 m posts; by default 10.8 G posts, 22 GB as a GeoTIFF, of which the store takes about
# half again. FOLDER keeps terrain and store for another time; without one both are made in the temporary folder and gone at the end.
# --range: km; 0 is all of the raster, for `coverage`; `simulate` takes 300 km then. By hand: an hour or so.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

folder=
rest=()
while (($#)); do
    if [[ $1 == --folder && -n ${2-} ]]; then
        mkdir -p "$2"
        folder=$(realpath "$2")
        shift 2
    else
        rest+=("$1")
        shift
    fi
done
source bench/setup.sh
bench_setup "--posts 104000
--heights 500 3000
--range 0
--memory 256MiB" "${rest[@]}"

[[ -n $folder ]] || folder=$work
cd "$folder"
y=$((4500000 - 30 * (posts / 2) - 15)) x=$((400000 + 30 * (posts / 2) + 15))
name=huge$posts
megabytes() { du -sm --apparent-size "$1" | cut -f 1; }
# Out of the system's cache, as far as one may: of each file, clean pages.
forget() {
    sync
    find "$1" -type f -exec dd if={} iflag=nocache count=0 status=none \;
}
row() {  # words, cold or warm, posts in millions, report or ""
    local read=-
    [[ -z $4 ]] || read=$(python3 -c "import json; print(round(json.load(open('$4'))['total']['bytes_read'] / 1e6))")
    awk -v words="$1" -v how="$2" -v million="$3" -v read="$read" '{
        printf("%-34s %-5s %9.1f %9.1f %9.0f %10s %9.1f\n", words, how, $1, $2 + $3, $4 / 1024, read, million / $1) }' took
}
printf '%-34s %-5s %9s %9s %9s %10s %9s\n' "$posts x $posts, $memory" "" "wall s" "CPU s" "peak MiB" "MB read" Mposts/s
million=$(awk -v n="$posts" 'BEGIN { print n * n / 1e6 }')

if [[ ! -e $name.store/manifest.json ]]; then
    [[ -e $name.tif ]] || { "$tools/make_terrain" ridged "$posts" "$name.part.tif" && mv "$name.part.tif" "$name.tif"; }
    forget "$name.tif"
    "$tools/measure" took "$program" tile "$name.tif" "$name.store" --overwrite --quiet --memory "$memory"
    row "tile, $(megabytes "$name.tif") MB to $(megabytes "$name.store") MB" cold "$million" ""
fi
limit=() radius=(--range 300km)
if ((range)); then limit=(--range "${range}km") radius=("${limit[@]}"); fi
for height in $heights; do
    place=(--xy "$x,$y" --altitude-agl "${height}m" --geometry grid --memory "$memory" --overwrite --quiet --report report.json)
    for command in coverage simulate; do
        for how in cold warm; do
            [[ $how == warm ]] || forget "$name.store"
            if [[ $command == coverage ]]; then
                "$tools/measure" took "$program" coverage "${place[@]}" "${limit[@]}" "$name.store" mask.tif
            else
                "$tools/measure" took "$program" simulate "${place[@]}" "${radius[@]}" --dem "$name.store" -o scope.png
            fi
            row "$command from $height m" "$how" "$million" report.json
        done
    done
done
rm -f took report.json mask.tif scope.png
