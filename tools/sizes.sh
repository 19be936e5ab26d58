#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Measures what the filter costs on each board (flash, RAM, stack, instructions) and writes
# docs/SIZES.md.
#
# usage: tools/sizes.sh [--check]
#
#   --check   measures, and compares with docs/SIZES.md instead of writing it
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

action=write
case ${1-} in
'') ;;
--check) action=check ;;
-h | --help)
    sed -n '3,8s/^# \{0,1\}//p' "$0"
    exit 0
    ;;
*) die "no option $1: tools/sizes.sh [--check]" ;;
esac
BENCH=$ROOT/build/robot-sizes

heading 'Set-up'
ensure_packages "${PACKAGES_BUILD[@]}" gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm
ensure_python
mkdir -p "$LOGS" "$BENCH"

heading 'Building every board with every capacity (build/robot-sizes)'
"$VENV/bin/python" -m pelorus.robot.sizes recording "$BENCH/bench.plr"
build() {
    cmake -S "$ROOT/port/cortex_m" -B "$BENCH" -DCMAKE_BUILD_TYPE=None \
        --toolchain "$ROOT/port/cortex_m/toolchain.cmake" \
        -DPELORUS_MAVLINK=ON -DPython3_EXECUTABLE="$VENV/bin/python" \
        '-DPELORUS_CAPACITIES=8;16;32;64' -DPELORUS_BENCH_RECORDING="$BENCH/bench.plr" &&
        cmake --build "$BENCH" -j "$JOBS" --target boards bench
}
if ! build >"$LOGS/sizes-build.log" 2>&1; then
    tail -40 "$LOGS/sizes-build.log"
    die "the build failed: the whole of it is in $LOGS/sizes-build.log"
fi

heading 'Measuring under QEMU'
"$VENV/bin/python" -m pelorus.robot.sizes "$action" "$BENCH" "$ROOT/docs/SIZES.md"
[ "$action" = check ] || echo 'docs/SIZES.md'
