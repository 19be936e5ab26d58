# SPDX-License-Identifier: MIT
# shellcheck shell=bash
# The firmware's files of a release. Sourced by tools/release.sh, behind tools/setup.sh.

# is_untried BOARD: it has run neither on hardware nor in an emulator; port/cortex_m/cmake/Boards.cmake says so.
is_untried() {
    grep -q "^set(board_$1_untried TRUE)" "$ROOT/port/cortex_m/cmake/Boards.cmake"
}

# copy_images OUT VERSION BOARD...: .elf, .bin and .hex of each, and FIRMWARE.txt, which says what each has run on.
copy_images() {
    local out=$1 version=$2 board image name end
    shift 2
    printf 'Firmware of Pelorus %s. No board of these has run on hardware yet: all but the untried ones\n' "$version"
    printf 'have run in an emulator, with the same bits as a desktop.\n\n'
    for board in "$@"; do
        image=pelorus-$board-n32 name=pelorus-$version-$board-n32
        if is_untried "$board"; then
            name+=-untried
            printf '%s: UNTRIED. It has run neither on hardware nor in an emulator; docs/PORTING.md says\n' "$name"
            printf '    what to look at first.\n'
        else
            printf '%s: emulated\n' "$name"
        fi
        for end in elf bin hex; do
            cp "$ROBOT/images/$image.$end" "$out/$name.$end" || return 1
        done
    done
} >"$1/FIRMWARE.txt"
