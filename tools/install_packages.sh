#!/usr/bin/env bash
# Installs the Debian 12 packages that are missing, and only those; with none missing it needs no rights at all.
#   tools/install_packages.sh [--tests] [--bench]
set -euo pipefail

packages=(
    g++ cmake ninja-build
    libgdal-dev libtbb-dev libgeographiclib-dev libboost-program-options-dev
    libfmt-dev nlohmann-json3-dev libzstd-dev libxxhash-dev libhwy-dev libpng-dev zlib1g-dev libproj-dev
    libtiff-dev
    libopenimageio-dev fonts-dejavu-core  # the picture helper and the letters of its legends
)
for option in "$@"; do
    case $option in
        --tests) packages+=(catch2 gdal-bin ccache locales libgeotiff-dev) ;;  # locales: one with a decimal comma
        --bench) packages+=(gdal-bin gnuplot-nox grass-core) ;;
        *)
            echo "install_packages.sh: '$option' is not known; accepted are --tests and --bench" >&2
            exit 2
            ;;
    esac
done

if ! command -v dpkg-query >/dev/null; then
    echo "No dpkg here, so nothing is installed. What Debian 12 calls: ${packages[*]}" >&2
    exit 0
fi
missing=()
for package in "${packages[@]}"; do
    status=$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null || true)
    [[ $status == installed ]] || missing+=("$package")
done
((${#missing[@]})) || exit 0

if ((EUID == 0)); then
    as_root=(env)
elif command -v sudo >/dev/null && { sudo -n true 2>/dev/null || { [[ -t 0 ]] && sudo true; }; }; then
    as_root=(sudo env)
else
    echo "These packages are missing, and installing them needs root or sudo: ${missing[*]}" >&2
    echo "As root: apt-get update && apt-get install --no-install-recommends ${missing[*]}" >&2
    exit 1
fi

log=$(mktemp)
trap 'rm -f "$log"' EXIT
apt() {  # quiet; the last lines of its talk where it fails
    "${as_root[@]}" DEBIAN_FRONTEND=noninteractive apt-get -qq -o DPkg::Lock::Timeout=600 -o Acquire::Retries=3 \
        -o Dpkg::Use-Pty=0 "$@" </dev/null >"$log" 2>&1
}
echo "Installing ${#missing[@]} packages with what they need: ${missing[*]}" >&2
# The lock on the package lists knows no waiting: another apt may hold it for a while.
for ((try = 1; ; ++try)); do
    apt update && break
    if ((try == 60)) || ! grep -q 'lock' "$log"; then
        tail -n 20 "$log" >&2
        echo "apt-get update failed; the package lists at hand are tried." >&2
        break
    fi
    sleep 5
done
if ! apt install -y --no-install-recommends "${missing[@]}"; then
    tail -n 30 "$log" >&2
    echo "apt-get could not install: ${missing[*]}" >&2
    exit 1
fi
