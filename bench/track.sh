#!/usr/bin/env bash
# Small ground, many pictures: POSTS x 2 POSTS with culture, 360 degrees. A whole process to PNG, wall seconds; and frames a
# second of --track, on one thread and on all, each quality, in turns, warm.
#   bench/track.sh [--posts 1000] [--frames 40] [--rounds 3] [--program PATH]
# The ground is the shipped inland_empire terrain and culture, stretched to that size, 30-m posts, from a store and plain.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

source bench/setup.sh
bench_setup "--posts 1000
--frames 40
--rounds 3" "$@"

corner=(400000 4500000 "$((400000 + 60 * posts))" "$((4500000 - 30 * posts))")
for layer in dem culture; do
    smooth=nearest
    [[ $layer == culture ]] || smooth=bilinear
    gdal_translate -q -outsize "$((2 * posts))" "$posts" -r "$smooth" -co TILED=YES -a_ullr "${corner[@]}" \
        "$data/inland_empire_$layer.tif" "$layer.tif"
done
"$program" tile dem.tif --culture culture.tif --culture-legend fbfm40 ground.store --quiet
awk -v n="$frames" -v posts="$posts" 'BEGIN {
    print "time,x,y,altitude-msl,heading"
    for (i = 0; i < n; ++i)
        printf("%.2f,%.1f,%.1f,2500,90\n", i / 40, 400000 + posts * 30 * (0.8 + 0.4 * i / n), 4500000 - posts * 15.2) }' >track.csv

scene() {  # source, quality, threads
    command=("$program" simulate --geometry grid --overwrite --quiet --quality "$2" --threads "$3" --range 20km)
    if [[ $1 == store ]]; then command+=(--dem ground.store); else command+=(--dem dem.tif --culture culture.tif --culture-legend fbfm40); fi
}
printf '%-6s %-7s %7s %14s %12s %12s\n' from quality threads "process wall s" frames/s "opening s"
for ((round = 0; round <= rounds; ++round)); do  # the first to warm up
    for quality in draft normal fine exact; do
        for from in store plain; do
            for threads in 1 "$all_threads"; do
                scene "$from" "$quality" "$threads"
                "$tools/measure" took "${command[@]}" --xy "$((400000 + 30 * posts)),$((4500000 - 15 * posts))" --altitude-msl 2500m -o scope.png
                "${command[@]}" --track track.csv -o scope.png --report report.json
                rm -f scope*.png
                ((round == 0)) || python3 -c "
import json
r = json.load(open('report.json'))
print(open('took').read().split()[0], r['frames_per_second'], r['open_s'])" >>"times.$from.$quality.$threads"
            done
        done
    done
done
for quality in draft normal fine exact; do
    for from in store plain; do
        for threads in 1 "$all_threads"; do
            middle "times.$from.$quality.$threads" | awk -v f="$from" -v q="$quality" -v t="$threads" \
                '{ printf("%-6s %-7s %7d %14.2f %12.1f %12.2f\n", f, q, t, $1, $2, $3) }'
        done
    done
done
