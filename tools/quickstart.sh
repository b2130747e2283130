#!/usr/bin/env bash
# From a fresh clone to a radar scope: installs what is missing (Debian 12), builds, runs the demo scene.
#   tools/quickstart.sh
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

bash tools/install_packages.sh
cmake --preset release -DWEDGESCOPE_TESTS=OFF -DWEDGESCOPE_BENCH=OFF --log-level=WARNING
cmake --build --preset release --parallel "$(nproc)"

scene=f111a_sector90
mkdir -p build/demo
build/release/tools/wedgescope simulate "docs/scenes/$scene.ini" --overwrite \
    --output "build/demo/$scene.png" --report "build/demo/$scene.json"
echo
echo "The scope:   $PWD/build/demo/$scene.png"
echo "The report:  $PWD/build/demo/$scene.json"
echo "The scene:   $PWD/docs/scenes/$scene.ini (others beside it)"
echo "The program: $PWD/build/release/tools/wedgescope help"
