#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Shows the filter on an emulated robot controller: sets up, builds the firmware, runs the board in
# QEMU, sends it a simulated drive over its UART, and compares its answers with this machine's, to
# the bit.
#
# usage: tools/robot-demo.sh [BOARD [RECORDING.plr]]
#        tools/robot-demo.sh --pictures [BOARD]
#
# With --pictures the board (stm32f405, mps2_an500 or mps3_an547) has eyes, and pictures of a drive in its image: each pair's
# observations and pose are compared, and instructions are counted.
# BOARD is stm32f405 (the default), mps2_an386, mps2_an500 or mps3_an547. The flight log is left in
# out/flight-BOARD.plr, the firmware in build/robot/images.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

case ${1-} in
-h | --help)
    sed -n '3,14s/^# \{0,1\}//p' "$0"
    exit 0
    ;;
esac
pictures=0
[ "${1-}" != --pictures ] || { pictures=1 && shift; }
[ $# -le 2 ] || die "too many arguments: tools/robot-demo.sh [BOARD [RECORDING.plr]]"
board=${1-stm32f405}
recording=${2-}
image=pelorus-$board-n32
if [ $pictures = 1 ]; then
    image=eyes-replay-$board
    grep -q "set(board_${board}_eyes" "$ROOT/port/cortex_m/cmake/Boards.cmake" || die "no eyes for a board $board"
fi
[ -d "$ROOT/port/cortex_m/boards/$board" ] ||
    die "no board $board; there are: $(cd "$ROOT/port/cortex_m/boards" && echo */ | tr -d /)"
[ -z "$recording" ] || [ -r "$recording" ] || die "$recording: cannot be read"
[ -z "$recording" ] || recording=$(realpath "$recording")

heading 'Set-up'
ensure_packages "${PACKAGES_BUILD[@]}" \
    gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm
ensure_python

heading "Building: firmware for $board, and this machine's replay"
mkdir -p "$LOGS" "$ROOT/out"
build() {
    build_desktop && build_robot "$image"
}
if ! build >"$LOGS/robot-demo-build.log" 2>&1; then
    tail -40 "$LOGS/robot-demo-build.log"
    die "the build failed: the whole of it is in $LOGS/robot-demo-build.log"
fi
arm-none-eabi-size "$ROBOT/images/$image.elf"

cd "$ROOT"
if [ $pictures = 1 ]; then
    heading "Pictures, on the emulated $board and at the desk"
    PYTHONPATH=$ROOT/tools "$VENV/bin/python" -m firmware.eyes "$board" \
        "$ROBOT/images/eyes-replay-$board.elf" "$ROBOT/pictures/$board.plr" build/bin/pelorus-replay
    exit
fi
if [ -z "$recording" ]; then
    heading 'Simulating a drive'
    recording=$ROOT/out/robot-demo.plr
    "$VENV/bin/pelorus" simulate "$recording" --seed 7 --duration 20 --force
fi

heading "Sending it to the emulated $board"
"$VENV/bin/pelorus" stream "$recording" --to "qemu:$board" \
    --record "out/flight-$board.plr" --force --compare

heading 'Done'
echo "What board and host said to each other: out/flight-$board.plr (pelorus info shows it)"
