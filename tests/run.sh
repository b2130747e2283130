#!/usr/bin/env bash
# Installs what is missing (Debian 12), builds, runs the tests; the last line counts them.
#   tests/run.sh                       all of release, asan without the long comparisons, tsan of what threads share
#   tests/run.sh --preset release      only this preset, all of its tests (asan, tsan, dev, release; may be repeated)
#   tests/run.sh ... -- CTEST_OPTIONS  handed to ctest, as in: tests/run.sh --preset asan -- -R sweep
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

presets=()
while (($#)) && [[ $1 != -- ]]; do
    case "$1 ${2-}" in
        "--preset release" | "--preset asan" | "--preset tsan" | "--preset dev") presets+=("$2"); shift 2 ;;
        *)
            echo "run.sh: '$*' is not understood; accepted are --preset release|asan|tsan|dev and -- CTEST_OPTIONS" >&2
            exit 2
            ;;
    esac
done
(($#)) && shift
ctest_options=("$@")
jobs=$(nproc)

bash tools/install_packages.sh --tests

# The shadow memory of g++ 12's sanitizers does not bear the address randomisation of newer kernels.
fixed_addresses=()
if setarch -R true 2>/dev/null; then fixed_addresses=(setarch -R); fi

passed=0 failed=0 skipped=0 summary=()
results=$(mktemp)
trap 'rm -f "$results"' EXIT

attribute() {
    local value
    value=$(sed -n "s/.*[[:space:]]$1=\"\([0-9]*\)\".*/\1/p" "$results" | head -n 1)
    echo "${value:-0}"
}

run() {  # preset, options for ctest
    local preset=$1 launcher=() began=$SECONDS built status=0
    shift
    case $preset in asan | tsan) launcher=("${fixed_addresses[@]}") ;; esac
    echo "== $preset"
    cmake --preset "$preset" -DWEDGESCOPE_TESTS=ON --log-level=WARNING
    # Under a sanitizer only what these tests need: compiling takes longer there than running.
    local targets=()
    case $preset in
        asan | tsan)
            mapfile -t targets < <(ctest --preset "$preset" -N "$@" "${ctest_options[@]}" |
                sed -n 's/^ *Test *#[0-9]*: *//p' |
                sed 's/_threads$/_test/; s/_quick$/_test/; s/_brief$/_test/; s/_every_[a-z]*$/_test/; s/^reference_check$/wedgescope_reference_check/' | sort -u)
            targets=(--target wedgescope wedgescope_picture "${targets[@]}")
            ;;
    esac
    "${launcher[@]}" cmake --build --preset "$preset" --parallel "$jobs" "${targets[@]}"
    built=$SECONDS
    : >"$results"
    "${launcher[@]}" ctest --preset "$preset" --parallel "$jobs" --output-junit "$results" "$@" "${ctest_options[@]}" || status=$?
    local ran bad out
    ran=$(attribute tests) bad=$(attribute failures)
    out=$(($(attribute skipped) + $(attribute disabled)))
    if ((status != 0 && bad == 0)); then bad=1; fi  # ctest itself found fault
    ((passed += ran - bad - out, failed += bad, skipped += out)) || true
    summary+=("$preset: $ran tests, $bad failed; build $((built - began)) s, tests $((SECONDS - built)) s")
}

if ((${#presets[@]})); then
    for preset in "${presets[@]}"; do run "$preset"; done
else
    run release
    # Minutes there, for nothing that the others do not try (whole programs sweep, count, take levels and write by GDAL in cli and
    # track); or no memory to speak of.
    run asan --exclude-regex '^(reference|matrix|numerics|cull|same_bits|viewshed|options|earth|material|random|receiver|fluctuation|atmosphere|rain|path_loss|backscatter|sea|dielectric|intensity|walls|far_shore|observers|resume|weather|class_laws|late_libraries|link_budget|beam|crs|response|cyclic_coverage|coverage_layers|class_table|evaluate|report|targets|timeline|output_formats|refine)_|_every_ground$|^(cli|coverage|culture_lanes|detail|engine|evaluate|feature_places|features|link_budget|paper|scope|spilled_source|tile_store|track|wedges)_test$'
    run tsan --tests-regex '^(memory_budget|threads|timeline)_test$|_threads$'
fi

echo
printf '%s\n' "${summary[@]}"
((passed + failed)) || { echo "no test ran" >&2; failed=1; }
echo "$passed passed, $failed failed, $skipped skipped"
((failed == 0))
