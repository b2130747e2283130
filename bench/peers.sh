#!/usr/bin/env bash
# Masks of visibility by others and by coverage, on the same posts, in turns, warm: wall, CPU, peak memory, and posts that
# an exact walk of the rays says are wrong (bench/check_mask); and the picture of simulate, which is more than a mask.
#   bench/peers.sh [--sizes "1000x2000 2000 10000 20000"] [--heights "100 500 3000 9000"] [--rounds 3] [--posts 100000] [--memory 256MiB]
#                  [--grass 2000] [--program PATH]
# Sizes are of squares, or COLUMNSxROWS. Mountains (make_terrain ridged), int16, 30 m posts; HEIGHT m above the ground in the middle. First every height, each
# program on the file it likes best: gdal_viewshed a plain tiled GeoTIFF, coverage a store, r.viewshed its own data base
# (timed without import and export; sizes above --grass are left out: it takes minutes and asks for all memory). Then,
# from 500 m, the same posts in other files. Rasters of 20000 take 20 GB of memory (the exact walk) and of temporary disk.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

source bench/setup.sh
bench_setup "--sizes 1000x2000 2000 10000 20000
--heights 100 500 3000 9000
--rounds 3
--posts 100000
--memory 256MiB
--grass 2000" "$@"

threads_words() { if (($1 == 1)); then echo "1 thread"; else echo "$1 threads"; fi; }
ours() {  # input, mask, threads, quality
    command=("$program" coverage --xy "$x,$y" --altitude-agl "${height}m" --geometry grid --memory "$memory" --overwrite --quiet
        --threads "$3" --quality "$4" "$1" "$2")
}
scope() {  # input, picture, threads, quality
    command=("$program" simulate --xy "$x,$y" --altitude-agl "${height}m" --geometry grid --memory "$memory" --overwrite --quiet
        --threads "$3" --quality "$4" --range "${reach}m" --dem "$1" -o "$2")
}
theirs() { command=(gdal_viewshed -q -ox "$x" -oy "$y" -oz "$height" -cc 0.75 "$1" "$2"); }

# Lines "case|command...": each command is run --rounds times, in turns; "took.CASE" keeps its middle.
declare -A commands
order=()
add() {
    order+=("$1")
    commands[$1]=$(printf '%q ' "${command[@]}")
}
run_all() {
    local round case
    for ((round = 0; round <= rounds; ++round)); do  # the first to warm up
        for case in "${order[@]}"; do
            eval "\"$tools/measure\" took ${commands[$case]}"
            if ((round)); then
                cat took >>"times.$case"
                echo >>"times.$case"
            fi
        done
    done
    for case in "${order[@]}"; do middle "times.$case" >"took.$case"; done
    rm -f times.*
}
row() {  # case, mask or "", words
    local wrong="" visible="-"
    if [[ -n $2 ]]; then
        read -r visible wrong _ iou _ < <("$tools/check_mask" "$terrain.tif" "$x" "$y" "$height" "$posts" "$2")
        wrong="$wrong $iou"
    fi
    awk -v size="$size" -v height="$height" -v visible="$visible" -v words="$3" -v wrong="${wrong:-- -}" -v base="$(cut -d ' ' -f 1 took.viewshed)" '{
        split(wrong, w, " ")
        printf("%9s %6d %9s  %-34s %8.2f %8.2f %8.0f %7.2f %9s %7s\n", size, height, visible, words, $1, $2 + $3, $4 / 1024, base / $1, w[1], w[2])
    }' "took.$1"
}
head='%9s %6s %9s  %-34s %8s %8s %8s %7s %9s %7s\n'
heading() { printf "$head" posts "m AGL" "visible %" program "wall s" "CPU s" "peak MiB" "ratio" "wrong %" IoU; }

terrain=ridged
heading
for size in $sizes; do
    columns=${size%x*} rows=${size#*x}
    longer=$((columns > rows ? columns : rows))
    y=$((4500000 - 30 * (rows / 2) - 15)) x=$((400000 + 30 * (columns / 2) + 15))
    reach=$((22 * longer))  # to the corners of a square
    "$tools/make_terrain" "$terrain" "$longer" "$terrain.tif"
    if ((columns != rows)); then
        gdal_translate -q -co TILED=YES -srcwin 0 0 "$columns" "$rows" "$terrain.tif" part.tif
        mv part.tif "$terrain.tif"
    fi
    "$program" tile "$terrain.tif" "$terrain.store" --overwrite --quiet --memory "$memory"
    for height in $heights; do
        order=()
        theirs "$terrain.tif" viewshed.tif
        add viewshed
        for threads in 1 $all_threads; do
            ours "$terrain.store" "normal.tif" "$threads" normal
            add "normal$threads"
        done
        for quality in draft fine exact; do
            ours "$terrain.store" "$quality.tif" "$all_threads" "$quality"
            add "$quality"
        done
        for threads in 1 $all_threads; do
            for quality in normal exact; do
                scope "$terrain.store" scope.png "$threads" "$quality"
                add "scope.$quality$threads"
            done
        done
        command=(gdal_translate -q -co TILED=YES "$terrain.store/dem.vrt" copy.tif)
        add copy
        run_all
        row viewshed viewshed.tif "gdal_viewshed, 1 thread"
        row normal1 "" "coverage normal, 1 thread"
        row "normal$all_threads" normal.tif "coverage normal, $(threads_words "$all_threads")"
        for quality in draft fine exact; do row "$quality" "$quality.tif" "coverage $quality, $(threads_words "$all_threads")"; done
        for quality in normal exact; do
            for threads in 1 $all_threads; do row "scope.$quality$threads" "" "simulate $quality, $(threads_words "$threads")"; done
        done
        row copy "" "gdal_translate of the store"
        if ((longer <= grass)) && command -v grass >/dev/null; then
            cat >job.sh <<EOF
export GRASS_VERBOSE=0
r.in.gdal -o input=$terrain.tif output=dem
g.region raster=dem
"$tools/measure" took.grass r.viewshed -c -r refraction_coeff=0.25 input=dem output=seen coordinates=$x,$y observer_elevation=$height memory=8000
r.out.gdal -f input=seen output=grass.tif type=Float32 nodata=-9999 --overwrite
EOF
            grass --tmp-location "$terrain.tif" --exec bash job.sh >grass.log 2>&1 || { tail -n 5 grass.log >&2; exit 1; }
            row grass grass.tif "r.viewshed, 1 thread"
        fi
    done
    height=500
    echo
    heading
    gdal_translate -q -ot Float32 -co TILED=YES -co BLOCKXSIZE=256 -co BLOCKYSIZE=256 "$terrain.tif" float.tif
    "$program" tile float.tif float.store --overwrite --quiet --memory "$memory"
    gdal_translate -q -co TILED=YES -co BLOCKXSIZE=256 -co BLOCKYSIZE=256 -co COMPRESS=DEFLATE -co PREDICTOR=2 "$terrain.tif" deflate.tif
    gdal_translate -q -co TILED=YES -co BLOCKXSIZE=256 -co BLOCKYSIZE=256 -co COMPRESS=ZSTD -co PREDICTOR=2 "$terrain.tif" zstd.tif
    for file in "$terrain" float deflate zstd; do
        order=()
        theirs "$file.tif" viewshed.tif
        add viewshed
        ours "$file.tif" plain.tif "$all_threads" normal
        add plain
        if [[ -d $file.store ]]; then
            ours "$file.store" normal.tif "$all_threads" normal
            add store
        fi
        run_all
        row viewshed viewshed.tif "gdal_viewshed, $file.tif"
        row plain plain.tif "coverage, $(threads_words "$all_threads"), $file.tif"
        if [[ -d $file.store ]]; then row store normal.tif "coverage, $(threads_words "$all_threads"), $file.store"; fi
    done
    rm -rf ./*.tif ./*.store
    echo
    if [[ $size != "${sizes##* }" ]]; then heading; fi
done
