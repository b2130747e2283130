#!/bin/bash
# Level of detail: the same ground with fractal detail at 30, 10, 5 and 2.5 m posts, a quarter of a 30-nmi scope, `normal`:
#   bench/detail.sh BUILD FOLDER [POST_M...]
# FOLDER takes rasters and stores (30 m to 5 m: 1 GB; 2.5 m: 4 GB) and is made if it is missing; stores that stand there are
# used again. Prints for each posting, levels on and off by turns: CPU seconds of the process, samples, bytes read and their share
# of those in range, posts read by level.
set -eu
[ $# -ge 2 ] || { echo "usage: bench/detail.sh BUILD FOLDER [POST_M...]" >&2; exit 2; }
build=$(realpath "$1")
mkdir -p "$2"
cd "$2"
shift 2
[ $# -gt 0 ] || set -- 30 10 5 2.5
for post in "$@"; do
    [ -e "f$post/manifest.json" ] && continue
    "$build/bench/make_terrain" fractal "$(awk -v p="$post" 'BEGIN { print int(56000 / p) + 1 }')" "f$post.tif" 1 "$post"
    "$build/tools/wedgescope" tile -q "f$post.tif" "f$post"
    rm "f$post.tif"
done
for post in "$@"; do
    for detail in auto off; do
        "$build/tools/wedgescope" simulate -q --overwrite --dem "f$post" --xy 400600,4444600 --altitude-agl 7000ft \
            --geometry grid --sector 2deg,88deg --range 30nmi --pulse 1us --range-bin 37.5m --gamma -15dB --detail $detail \
            --threads 1 -o scope.png --power "power_${post}_$detail.tif" --report report.json
        python3 - "$post" $detail << 'END'
import json, sys
r = json.load(open('report.json'))
t, skipped = r['total'], r['skipped']
in_range = r['read']['bytes'] + sum(v['bytes'] for k, v in skipped.items() if k != 'range')
print(f"{sys.argv[1]:>4} m, detail {sys.argv[2]:4}: {r['user_s'] + r['system_s']:6.2f} CPU s, {t['samples'] / 1e6:6.1f} M samples, "
      f"{t['bytes_read'] / 1e6:7.1f} MB read, {100 * t['bytes_read'] / in_range:5.1f} % of those in range; posts by level: "
      + ', '.join(f"{l['level']}: {l['posts_read'] / 1e6:.2f} M" for l in r['levels']))
END
    done
done
