#!/usr/bin/env bash
# Every loop marked WEDGESCOPE_INDEPENDENT becomes vector code in the copies for AVX2 and AVX-512: the compiler gives that up
# silently, for a choice too many, and the loop then takes several times as long with the same bits.
#   tests/lanes_test.sh COMPILER FLAGS...
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
compiler=("$@")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

check() {  # source file
    local source=$1 name lines
    name=$(basename "$source" .cpp)
    lines=$(grep -n "^ *WEDGESCOPE_INDEPENDENT" "$source" | cut -d : -f 1 | tr '\n' ' ')
    "${compiler[@]}" -I. -c "$source" -o "$work/$name.o" -fdump-tree-vect-optimized-missed="$work/$name.dump"
    # The compiler tells function by function which loops it vectorised; a template's loop stands in one several times.
    awk -v source="$source" -v lines="$lines" '
        BEGIN { count = split(lines, mark, " "); split("avx2 avx512", copies, " ") }
        /^;; Function / { copy = $0; sub(/ \(_Z.*/, "", copy); sub(/.*::/, "", copy); sub(/\..*/, "", copy) }
        index($1, source ":") == 1 && copy ~ /^avx/ {
            split($1, place, ":")
            if (/optimized: loop vectorized/) done[copy, place[2]] = 1
            if (/missed: couldn.t vectorize loop/) missed[copy, place[2]] = 1
        }
        END {
            for (i = 1; i <= count; ++i)
                for (c in copies) {
                    key = copies[c] SUBSEP (mark[i] + 1)
                    if ((key in done) && !(key in missed)) continue
                    print source ":" mark[i] + 1 ": no vector code for " copies[c] > "/dev/stderr"
                    bad = 1
                }
            exit bad
        }' "$work/$name.dump"
}

mapfile -t sources < <(grep -l "^ *WEDGESCOPE_INDEPENDENT" lib/*.cpp)
((${#sources[@]} > 0)) || { echo "no such loop found in lib" >&2; exit 1; }
bad=0
for source in "${sources[@]}"; do check "$source" || bad=1; done
((bad == 0)) && echo "${#sources[@]} files, every marked loop is vector code"
exit $bad
