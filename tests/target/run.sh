#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Builds the firmware and the desktop's replay in all the ways that must agree, and runs the tests on
# the emulated boards, two at a time.
#
# usage: tests/target/run.sh [BOARD...]
#
# Without a BOARD it takes all of them, and holds docs/SIZES.md against what is measured now.
# PELORUS_LONG=1 adds whole real recordings. Everything is left in build/robot; each board's output
# in build-logs/target-BOARD.log.
set -uo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../../tools/setup.sh"

BOARDS=(mps2_an386 mps2_an500 mps3_an547 stm32f405)
[ $# -eq 0 ] || BOARDS=("$@")
ROBOT=$ROOT/build/robot
BOARD_SECONDS=14400 # against hangs: a busy machine takes four times as long, or ten
long=()
[ "${PELORUS_LONG:-0}" = 1 ] && long=(--long) && BOARD_SECONDS=28800
export PELORUS_DATA=${PELORUS_DATA:-$ROOT/../shared/data}

build_robot() {
    cmake -S "$ROOT/port/cortex_m" -B "$ROBOT" \
        --toolchain "$ROOT/port/cortex_m/toolchain.cmake" -DCMAKE_BUILD_TYPE=None \
        -DPELORUS_MAVLINK=ON -DPython3_EXECUTABLE="$VENV/bin/python" &&
        cmake --build "$ROBOT" -j "$JOBS" --target boards bringup
}

# build_desktop NAME COMPILER FLAGS ARCH: a replay with the boards' capacities.
build_desktop() {
    cmake -S "$ROOT" -B "$ROBOT/desktop-$1" -DCMAKE_BUILD_TYPE=None -DCMAKE_C_COMPILER="$2" \
        -DCMAKE_C_FLAGS="$3" -DPELORUS_ARCH="$4" -DPELORUS_DESKTOP_LANDMARKS=32 \
        -DPELORUS_DESKTOP_OBSERVATIONS=128 -DPELORUS_BUILD_TESTS=OFF -DPELORUS_INSTALL=OFF &&
        cmake --build "$ROBOT/desktop-$1" -j "$JOBS"
}

build_all() {
    local clang
    clang=$(command -v clang-14 || command -v clang) || die 'clang is missing'
    build_robot &&
        build_desktop gcc-O2 gcc -O2 x86-64-v3 && build_desktop gcc-O3 gcc -O3 native &&
        build_desktop clang-O2 "$clang" -O2 x86-64-v3 && build_desktop clang-O3 "$clang" -O3 native
}

test_board() {
    local log=$LOGS/target-$1.log
    timeout "$BOARD_SECONDS" "$VENV/bin/python" -m pytest -rs -q -p no:cacheprovider \
        "$ROOT/tests/target" --board "$1" --robot "$ROBOT" --desktops "$ROBOT"/desktop-* \
        >"$log" 2>&1
    local status=$?
    [ $status -eq 124 ] && echo "1 failed in $BOARD_SECONDS s: the time is up" >>"$log"
    printf '%s: ' "$1"
    tail -1 "$log"
    return $status
}

# The n of "n WORD" in the last lines of all boards' logs.
total() {
    local board sum=0 n
    for board in "${BOARDS[@]}"; do
        n=$(tail -1 "$LOGS/target-$board.log" | grep -oE "[0-9]+ $1" | cut -d' ' -f1)
        sum=$((sum + ${n:-0}))
    done
    echo "$sum"
}

heading 'Set-up'
ensure_packages "${PACKAGES_BUILD[@]}" "${PACKAGES_TEST[@]}"
ensure_python
mkdir -p "$LOGS"

heading 'Building firmware, and the desktop in four ways (build/robot)'
if ! build_all >"$LOGS/target-build.log" 2>&1; then
    tail -40 "$LOGS/target-build.log"
    die 'the build failed: the whole of it is in build-logs/target-build.log'
fi
"$VENV/bin/python" "$ROOT/tests/target/recordings.py" "$ROBOT/recordings" "${long[@]}" ||
    die 'the recordings could not be made'

# Most of it needs one processor alone, so the boards run meanwhile.
sizes_check() {
    rm -f "$LOGS/target-sizes.passed"
    "$ROOT/tools/sizes.sh" --check >"$LOGS/target-sizes.log" 2>&1 &&
        touch "$LOGS/target-sizes.passed"
}

heading "Emulated boards: ${BOARDS[*]}"
failed=0
running=0 at_once=2
if [ $# -eq 0 ]; then
    sizes_check &
    running=1 at_once=3
fi
for board in "${BOARDS[@]}"; do
    test_board "$board" &
    running=$((running + 1))
    if [ $running -ge $at_once ]; then
        wait -n || failed=1
        running=$((running - 1))
    fi
done
while [ $running -gt 0 ]; do
    wait -n || failed=1
    running=$((running - 1))
done

for board in "${BOARDS[@]}"; do
    grep -hE '^(SKIPPED|FAILED|ERROR)' "$LOGS/target-$board.log"
done | sort -u
passes=$(total passed) failures=$(total failed)

if [ $# -eq 0 ]; then
    heading 'What it costs, against docs/SIZES.md'
    if [ -e "$LOGS/target-sizes.passed" ]; then
        passes=$((passes + 1))
        tail -1 "$LOGS/target-sizes.log"
    else
        failures=$((failures + 1)) failed=1
        tail -20 "$LOGS/target-sizes.log"
    fi
fi
echo "$passes passed, $failures failed, $(total skipped) skipped in $SECONDS.0s"
exit $failed
