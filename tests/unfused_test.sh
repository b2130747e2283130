#!/usr/bin/env bash
# No loop of the library, for whatever target, holds an instruction whose result is not that of the plain operations:
# fused multiply-adds, and reciprocals and roots that are only close. What AVX-512 would compute cannot be run on every
# machine, but it can be read there.
#   tests/unfused_test.sh OBJDUMP LIBRARY
set -euo pipefail
work=$(mktemp)
trap 'rm -f "$work"' EXIT
"$1" --disassemble --no-show-raw-insn "$2" >"$work"
for registers in xmm ymm zmm; do
    grep -q "%$registers" "$work" || { echo "$2: no code for $registers registers was found" >&2; exit 1; }
done
if awk -F '\t' '{ split($2, word, " "); print word[1] }' "$work" | grep -E '^v?(fn?m(add|sub)|rcp|rsqrt)' | sort | uniq -c >&2; then
    echo "$2: holds these instructions" >&2
    exit 1
fi
echo "$(grep -c '%zmm' "$work") instructions with AVX-512 registers, none fused and none approximate"
