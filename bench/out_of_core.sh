#!/usr/bin/env bash
# Large rasters in little memory: makes terrains, tiles them, checks that the ways give the same bits, then times coverage and
# simulate from the store and from a spill, on one thread and on all, beside gdal_viewshed on the same posts, in turns: on the plain
# file (gdal_viewshed, the ratio's measure) and on the store (viewshed_store).
#   bench/out_of_core.sh [--sizes "10000 20000"] [--rounds 3] [--memory 256MiB] [--program PATH]
# `ridged`: mountains from 500 m above the ground, most posts hidden; `bowl`: every post seen (simulate with --no-cull, so that
# direct and spilled do the same work). Takes half an hour and 4 GB of temporary disk.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

source bench/setup.sh
bench_setup "--sizes 10000 20000
--rounds 3
--memory 256MiB" "$@"

run() {  # case, terrain, threads: leaves the command in `command`
    local height=500 place extra=()
    [[ $2 == bowl* ]] && height=2900
    place=(--xy "$x,$y" --altitude-agl "${height}m" --geometry grid --memory "$memory" --threads "$3" --overwrite --quiet)
    case $1 in
        gdal_viewshed) command=(gdal_viewshed -q -ox "$x" -oy "$y" -oz "$height" -cc 0.75 "$2.tif" viewshed.tif) ;;
        viewshed_store) command=(gdal_viewshed -q -ox "$x" -oy "$y" -oz "$height" -cc 0.75 "$2.store/dem.vrt" viewshed.tif) ;;
        coverage) command=("$program" coverage "${place[@]}" "$2.store" coverage.tif) ;;
        direct | spilled)
            [[ $2 == bowl* ]] && extra=(--no-cull)
            command=("$program" simulate --dem "$2.store" --source "$1" "${place[@]}" "${extra[@]}" --quality exact --range-bin 100m
                --azimuth-bins 720 --echo echo.tif --report report.json -o scope.png --reproducible)
            ;;
    esac
}

printf '%-7s %6s %-14s %7s %7s %7s %9s %9s %7s\n' terrain posts program threads "wall s" "CPU s" Mposts/s "peak MiB" ratio
for posts in $sizes; do
    y=$((4500000 - 30 * (posts / 2) - 15)) x=$((400000 + 30 * (posts / 2) + 15))
    for terrain in ridged bowl; do
        "$tools/make_terrain" "$terrain" "$posts" "$terrain.tif"
        "$tools/measure" took "$program" tile "$terrain.tif" "$terrain.store" --overwrite --quiet --memory "$memory"
        awk -v t="$terrain" -v n="$posts" '{ printf("%-7s %6d %-14s %7s %7.2f %7.2f %9.1f %9.0f %7s\n", t, n, "tile", "all", $1, $2 + $3,
            n * n / 1e6 / $1, $4 / 1024, "-") }' took
        reference=
        for way in direct spilled; do
            run "$way" "$terrain" "$all_threads"
            "${command[@]}"
            bits=$(sha256sum <echo.tif)
            if [[ -n $reference && $bits != "$reference" ]]; then
                echo "$terrain: direct and spilled give other bits" >&2
                exit 1
            fi
            reference=$bits
        done
        cases=("gdal_viewshed 1" "viewshed_store 1" "coverage 1" "coverage $all_threads" "direct 1" "direct $all_threads" "spilled 1" "spilled $all_threads")
        rm -f times.*
        for ((round = 1; round <= rounds; ++round)); do
            for case in "${cases[@]}"; do
                read -r name threads <<<"$case"
                run "$name" "$terrain" "$threads"
                "$tools/measure" took "${command[@]}"
                cat took >>"times.$name.$threads"
                echo >>"times.$name.$threads"
            done
        done
        baseline=$(middle times.gdal_viewshed.1 | cut -d ' ' -f 1)
        for case in "${cases[@]}"; do
            read -r name threads <<<"$case"
            middle "times.$name.$threads" | awk -v t="$terrain" -v name="$name" -v threads="$threads" -v n="$posts" -v baseline="$baseline" '{
                printf("%-7s %6d %-14s %7d %7.2f %7.2f %9.1f %9.0f %7.2f\n", t, n, name, threads, $1, $2 + $3, n * n / 1e6 / $1,
                       $4 / 1024, baseline / $1) }'
        done
        rm -rf "$terrain.tif" "$terrain.store"
    done
done

echo
echo "Bytes read of bytes in range (decoded)"
for case in "azores_dem 38.47,-28.35 60m" "azores_dem 38.47,-28.35 6000m" "olympic_coast_dem 48.2,-124.3 60m" "olympic_coast_dem 48.2,-124.3 6000m"; do
    read -r name place height <<<"$case"
    "$program" tile "$data/$name.tif" "$name.store" --tile-size 64 --overwrite --quiet
    "$program" simulate --dem "$name.store" --latlon "$place" --altitude-agl "$height" --quiet --overwrite -o scope.png --report report.json
    read -r read planned < <(sed -n '/"bytes_read": {/,/}/p' report.json | grep -o '"\(planned\|actual\)": [0-9]*' | awk '{v[$1] = $2} END {print v["\"actual\":"], v["\"planned\":"]}')
    awk -v n="$name" -v h="$height" -v a="$read" -v b="$planned" 'BEGIN { printf("%-20s from %6s above the ground: %7.2f of %7.2f MB, %5.1f %%\n", n, h, a / 1e6, b / 1e6, 100 * a / b) }'
done
