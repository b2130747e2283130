# For the scripts beside it, which source it: options, a built program, a folder to work in that is gone at the end.
#   bench_setup "--name default ..." "$@"    sets the variable of each name ("--memory 256MiB": $memory), and program, tools, data,
#                                            work (where the script then stands), all_threads

bench_setup() {
    local -a known=()
    local accepted="" pair name script
    script=bench/$(basename "$0")
    while read -r name pair; do
        [[ -n $name ]] || continue
        known+=("${name#--}")
        printf -v "${name#--}" %s "$pair"
        accepted+="$name VALUE ($pair), "
    done <<<"$1"
    shift
    program=
    while (($#)); do
        name=${1#--}
        if [[ $1 == --program && -n ${2-} ]]; then
            program=$(realpath "$2")
        elif [[ $1 == --* && " ${known[*]} " == *" $name "* && ${2-} =~ ^[0-9] ]]; then
            printf -v "$name" %s "$2"
        else
            echo "$script: '$*' is not understood; accepted are ${accepted}--program PATH" >&2
            exit 2
        fi
        shift 2
    done
    bash tools/install_packages.sh --bench
    if [[ -z $program ]]; then
        cmake --preset release -DWEDGESCOPE_BENCH=ON --log-level=WARNING
        cmake --build --preset release --parallel "$(nproc)"
        program=$PWD/build/release/tools/wedgescope
    fi
    tools=$(dirname "$program")/../bench
    data=$PWD/tests/data
    all_threads=$(nproc)
    work=$(mktemp -d)
    trap 'rm -rf "$work"' EXIT
    cd "$work"
}

# The middle one of the lines of a file by their first number.
middle() { sed '/^$/d' "$1" | sort -n | awk '{ line[NR] = $0 } END { print line[int((NR + 1) / 2)] }'; }
