#!/usr/bin/env bash
# Every loop marked WEDGESCOPE_INDEPENDENT becomes vector code in the clones for AVX2 and AVX-512: the compiler gives that up
# silently, for a choice too many, and the loop then takes several times as long with the same bits.
#   tests/lanes_test.sh COMPILER FLAGS...
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
compiler=("$@")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

check() {  # source file
    local source=$1 name line said bad=0
    name=$(basename "$source" .cpp)
    for level in x86-64-v3 x86-64-v4; do
        "${compiler[@]}" -DWEDGESCOPE_ONE_CLONE -march=$level -mno-fma -I. -c "$source" -o "$work/$name.o" \
            -fopt-info-vec-all="$work/$name.$level"
        while read -r line; do
            said=$(grep ":$((line + 1)):" "$work/$name.$level" || true)
            if ! grep -q "optimized: loop vectorized" <<<"$said" || grep -q "control flow in loop" <<<"$said"; then
                echo "$source:$((line + 1)): no vector code for $level" >&2
                bad=1
            fi
        done < <(grep -n "^ *WEDGESCOPE_INDEPENDENT" "$source" | cut -d : -f 1)
    done
    return $bad
}

mapfile -t sources < <(grep -l "^ *WEDGESCOPE_INDEPENDENT" lib/*.cpp)
((${#sources[@]} > 0)) || { echo "no such loop found in lib" >&2; exit 1; }
bad=0
for source in "${sources[@]}"; do check "$source" || bad=1; done
((bad == 0)) && echo "${#sources[@]} files, every marked loop is vector code"
exit $bad
