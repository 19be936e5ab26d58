#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Builds the firmware, and the desktop's replay, and runs the tests on the emulated boards.
#
# usage: tests/target/run.sh [BOARD...]
#
# Without a BOARD it takes all of them, and holds docs/SIZES.md against what is measured now.
# PELORUS_LONG=1 adds whole real recordings, the sizes at N = 8, 16 and 64, and on every board what else is
# spread over them. Everything is left in build/robot, the tests' output in build-logs/target-boards.log; tests
# that failed are named at the end, with the reason.
set -uo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/../../tools/setup.sh"

BOARDS=(mps2_an386 mps2_an500 mps3_an547 stm32f405)
[ $# -eq 0 ] || BOARDS=("$@")
all=$#
BOARD_SECONDS=14400 # against hangs: a busy machine takes four times as long, or ten
long=()
export CAPACITIES=32
[ "${PELORUS_LONG:-0}" = 1 ] && long=(--long) && BOARD_SECONDS=28800 && CAPACITIES='8 16 32 64'
export PELORUS_DATA=${PELORUS_DATA:-$ROOT/../shared/data}
OUTPUT=$LOGS/target-boards.log

# What docs/SIZES.md is measured on comes out of the same build.
build_firmware() {
    local board targets=(eyes-stm32h743)
    if [ "$all" -eq 0 ]; then
        targets+=(boards bringup bench eyes-stm32f405 eyes-replay-stm32f405 eyes-mps2_an500 eyes-replay-mps2_an500
            eyes-mps3_an547 eyes-replay-mps3_an547)
    else
        for board in "${BOARDS[@]}"; do
            targets+=("pelorus-$board-n32" "bringup-$board" "kernels-$board")
            case $board in stm32f405 | mps2_an500 | mps3_an547) targets+=("eyes-$board" "eyes-replay-$board") ;; esac
            [ "$board" != mps2_an500 ] || targets+=("pelorus-$board-n32-f64")
        done
    fi
    build_robot "${targets[@]}"
}

# One queue for the tests of all boards. One process more than processors, for some tests wait for silence.
# CI: pytest cuts no reason short.
test_boards() {
    CI=true timeout "$BOARD_SECONDS" "$VENV/bin/python" -m pytest -rfEs -q -p no:cacheprovider \
        -n $((JOBS + 1)) --maxschedchunk 1 --durations 20 \
        "$ROOT/tests/target" --boards "${BOARDS[@]}" --robot "$ROBOT" \
        --desktop "$ROOT/build" "${long[@]}" >"$OUTPUT" 2>&1
    local status=$?
    [ $status -eq 124 ] && echo "1 failed in $BOARD_SECONDS s: the time is up" >>"$OUTPUT"
    return $status
}

# total WORD: the n of "n WORD" in the tests' last line.
total() {
    local n
    n=$(tail -1 "$OUTPUT" | grep -oE "[0-9]+ $1" | cut -d' ' -f1)
    echo "${n:-0}"
}

heading 'Set-up'
ensure_packages "${PACKAGES_BUILD[@]}" "${PACKAGES_TEST[@]}"
ensure_python
prefer_ninja
mkdir -p "$LOGS"

heading 'Building firmware (build/robot), and the desktop (build)'
"$VENV/bin/python" "$ROOT/tests/target/recordings.py" "$ROBOT/recordings" "${long[@]}" \
    >"$LOGS/target-recordings.log" 2>&1 &
recordings=$!
if ! { build_replays release && build_firmware; } >"$LOGS/target-build.log" 2>&1; then
    tail -40 "$LOGS/target-build.log"
    die 'the build failed: the whole of it is in build-logs/target-build.log'
fi
if ! wait $recordings; then
    tail -20 "$LOGS/target-recordings.log"
    die 'the recordings could not be made: build-logs/target-recordings.log'
fi
grep '^SKIPPED ' "$LOGS/target-recordings.log"
echo "built after $SECONDS s"

heading "Emulated boards: ${BOARDS[*]} (build-logs/target-boards.log)"
if [ $all -eq 0 ]; then
    "$ROOT/tools/sizes.sh" --check >"$LOGS/target-sizes.log" 2>&1 &
    sizes=$!
fi
test_boards
failed=$?
passes=$(total passed) failures=$(($(total failed) + $(total error)))
[ $failed -ne 0 ] && [ $failures -eq 0 ] && failures=1 # it did not come to the tests, or to their end

if [ $all -eq 0 ]; then
    heading 'What it costs, against docs/SIZES.md'
    if wait $sizes; then
        passes=$((passes + 1))
        tail -1 "$LOGS/target-sizes.log"
    else
        failures=$((failures + 1)) failed=1
        echo 'FAILED tools/sizes.sh --check (build-logs/target-sizes.log):'
        tail -20 "$LOGS/target-sizes.log"
    fi
fi

heading 'Tests on boards that were skipped or failed'
grep -hE '^(SKIPPED|FAILED|ERROR)' "$OUTPUT" | sort -u
[ $failed -eq 0 ] || [ "$(total passed)" -ne 0 ] || tail -40 "$OUTPUT"
echo "$passes passed, $failures failed, $(total skipped) skipped in $SECONDS.0s"
[ $failed -eq 0 ]
