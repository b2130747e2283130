#!/usr/bin/env bash
# Makes its own large terrains, checks the answers on them, then times `wedgescope simulate` and `gdal_viewshed` on the
# same files, one after the other in every round.
#   bench/run.sh [--posts 5000] [--rounds 3] [--program PATH]
# Two terrains: `ridged`, mountains from 500 m above the ground, where most posts are hidden; `bowl`, where every post
# is seen. The table gives the median of the rounds. The two programs' work differs: gdal_viewshed writes a mask, on
# one thread; simulate computes the echo of everything seen, on as many as shown, and draws the scope.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

source bench/setup.sh
bench_setup "--posts 5000
--rounds 3" "$@"

y=$((4500000 - 30 * (posts / 2) - 15)) x=$((400000 + 30 * (posts / 2) + 15))  # the post in the middle
declare -A height=([ridged]=500 [bowl]=2900)                                  # above the ground, metres

simulate() {  # terrain, options: leaves the command in `command`
    command=("$program" simulate --dem "$1.tif" --xy "$x,$y" --altitude-agl "${height[$1]}m" --geometry grid --quality exact
        --overwrite --reproducible --quiet "${@:2}")
}
viewshed() {  # terrain
    command=(gdal_viewshed -q -ox "$x" -oy "$y" -oz "${height[$1]}" -cc 0.75 "$1.tif" "$1.viewshed.tif")
}

echo "Terrains of $posts x $posts posts, 30 m, Int16, tiles of 256 x 256"
for terrain in ridged bowl; do "$tools/make_terrain" "$terrain" "$posts" "$terrain.tif"; done

echo "Answers"
bits() {  # options: the hash of echo and states
    simulate ridged --echo echo.tif --states states.tif "$@"
    "${command[@]}"
    cat echo.tif states.tif | sha256sum
}
reference=$(bits --wedges 1 --threads 1)
for split in "1 2" "7 1" "64 2"; do
    read -r wedges threads <<<"$split"
    if [[ $(bits --wedges "$wedges" --threads "$threads") != "$reference" ]]; then
        echo "  ridged: $wedges wedges on $threads threads give other bits than one wedge on one thread" >&2
        exit 1
    fi
done
echo "  ridged: the same bits for wedges x threads of 1 x 1, 1 x 2, 7 x 1, 64 x 2"
viewshed ridged && "${command[@]}"
simulate ridged --range-bin 100m --azimuth-bins 720 --states states.tif && "${command[@]}"
printf '  ridged: '
"$tools/check_visibility" ridged.tif ridged.viewshed.tif states.tif
simulate bowl --report bowl.json && "${command[@]}"
read -r _ _ shadow seen < <("$tools/report_figures" bowl.json)
echo "  bowl: $seen cells seen, $shadow in shadow"
if ((shadow != 0 || seen == 0)); then exit 1; fi

cases=("gdal_viewshed 1" "simulate 1")
if ((all_threads > 1)); then cases+=("simulate $all_threads"); fi
for ((round = 1; round <= rounds; ++round)); do
    for terrain in ridged bowl; do
        for case in "${cases[@]}"; do
            read -r name threads <<<"$case"
            figures="0 0"
            if [[ $name == gdal_viewshed ]]; then
                viewshed "$terrain"
            else
                simulate "$terrain" --threads "$threads" --output scope.png --report report.json
            fi
            "$tools/measure" took "${command[@]}"
            if [[ $name == simulate ]]; then figures=$("$tools/report_figures" report.json); fi
            echo "$(cat took) $figures" >>"$terrain.$name.$threads"
        done
    done
done

# A line of these files: wall, user, system seconds, peak KiB, CPU seconds of sample + sweep + shade and of deposit.
echo
echo "Median of $rounds rounds; ratio: wall time of gdal_viewshed / of this. sweep: sampling, sweep and shading alone, posts of the"
echo "raster a CPU second; all: with the deposit into cells."
printf '%-7s %-14s %7s %7s %7s %8s %8s %6s %9s %7s\n' terrain program threads "wall s" "CPU s" Mposts/s "peak MiB" ratio "sweep M/s" "all M/s"
for terrain in ridged bowl; do
    baseline=$(middle "$terrain.gdal_viewshed.1" | cut -d ' ' -f 1)
    for case in "${cases[@]}"; do
        read -r name threads <<<"$case"
        middle "$terrain.$name.$threads" |
            awk -v terrain="$terrain" -v name="$name" -v threads="$threads" -v posts="$posts" -v baseline="$baseline" '{
                n = posts * posts / 1e6
                printf("%-7s %-14s %7d %7.2f %7.2f %8.1f %8.0f %6.2f %9s %7s\n", terrain, name, threads, $1, $2 + $3, n / $1, $4 / 1024,
                       baseline / $1, $5 > 0 ? sprintf("%.1f", n / $5) : "-", $5 > 0 ? sprintf("%.1f", n / ($5 + $6)) : "-")
            }'
    done
done
