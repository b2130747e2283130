#!/usr/bin/env bash
# Many observers in one run beside as many single runs: wall and CPU, in turns, warm.
#   bench/observers.sh [--sizes "2000"] [--observers 50] [--ranges "0 5"] [--rounds 3] [--memory 1GiB] [--program PATH]
# Mountains (make_terrain ridged), int16, 30 m posts, SIZE x SIZE; observers all over them, 30 and 300 m above ground by turns, with
# a range of so many km (0: all of the raster).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

source bench/setup.sh
bench_setup "--sizes 2000
--observers 50
--ranges 0 5
--rounds 3
--memory 1GiB" "$@"

singles() {
    local x y height
    while IFS=, read -r x y height; do
        "$program" coverage --xy "$x,$y" --altitude-agl "${height}m" "${limits[@]}" ridged.tif single.tif
    done < <(tail -n +2 places.csv)
}
many() { "$program" coverage --observers places.csv "${limits[@]}" --threads "$1" ridged.tif counts.tif; }
# The counts are the sum of the single masks, post for post, or nothing is timed.
check_sum() {
    local x y height n=0
    {
        gdalinfo ridged.tif | awk -F'[ ,]+' '/^Size is/ {
            printf("<VRTDataset rasterXSize=\"%d\" rasterYSize=\"%d\">", $3, $4)
            print "<VRTRasterBand dataType=\"UInt16\" band=\"1\" subClass=\"VRTDerivedRasterBand\">"
            print "<PixelFunctionType>sum</PixelFunctionType>" }'
        while IFS=, read -r x y height; do
            "$program" coverage --xy "$x,$y" --altitude-agl "${height}m" "${limits[@]}" \
                --seen-value 1 --hidden-value 0 --outside-value 0 ridged.tif "mask$((++n)).tif" >&2
            echo "<SimpleSource><SourceFilename relativeToVRT=\"1\">mask$n.tif</SourceFilename></SimpleSource>"
        done < <(tail -n +2 places.csv)
        echo "</VRTRasterBand></VRTDataset>"
    } >sum.vrt
    many "$all_threads"
    gdal_translate -q -of ENVI sum.vrt sum.img
    gdal_translate -q -of ENVI counts.tif counts.img
    rm mask*.tif
    if ! cmp sum.img counts.img; then
        echo "observers.sh: the counts are not the sum of the single masks" >&2
        exit 1
    fi
    rm sum.* counts.img counts.hdr
}
# Wall, user and system seconds of a function, as one line.
timed() { { TIMEFORMAT='%R %U %S'; time "$@"; } 2>&1; }
row() { printf '%6s %9s %9s  %-28s %8s %8s %8s\n' "$@"; }

row posts observers "range km" program "wall s" "user s" "system s"
for size in $sizes; do
    "$tools/make_terrain" ridged "$size" ridged.tif
    awk -v n="$observers" -v size="$size" 'BEGIN {
        srand(7)
        print "x,y,height"
        for (i = 0; i < n; ++i)
            printf("%d,%d,%d\n", 400100 + rand() * (30 * size - 200), 4499900 - rand() * (30 * size - 200), i % 2 ? 30 : 300)
    }' >places.csv
    for range in $ranges; do
        limits=(--memory "$memory" --overwrite --quiet)
        if [[ $range != 0 ]]; then limits+=(--range "${range}km"); fi
        check_sum
        for ((round = 0; round <= rounds; ++round)); do  # the first to warm up
            for threads in 1 "$all_threads"; do timed many "$threads" >"took.many$threads.$round"; done
            timed singles >"took.singles.$round"
        done
        rm -f took.*.0
        for case in many1 "many$all_threads" singles; do
            cat took."$case".* >"times.$case"
            # shellcheck disable=SC2046
            row "$size" "$observers" "$range" "$(sed "s/many\(.*\)/one run, \1 threads/; s/singles/single runs, $all_threads threads/; s/ 1 threads/ 1 thread/" <<<"$case")" \
                $(middle "times.$case")
        done
    done
done
