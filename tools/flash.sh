#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Writes a firmware image into a real board's flash, with st-flash or OpenOCD.
#
# usage: tools/flash.sh [IMAGE] [--probe stlink|cmsis-dap|jlink]
#
# IMAGE is a .bin or .elf of an STM32F405 or STM32H743, by default
# build/robot/images/pelorus-stm32f405-n32. st-flash is taken where it is installed and the probe is
# an ST-Link, else OpenOCD.
#
# NOT TRIED ON HARDWARE: the images have run under QEMU alone. The commands are those of the tools'
# own manuals. Arm's MPS2 and MPS3 boards take an image as a file on their SD card instead.
set -euo pipefail

ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
FLASH_START=0x08000000
image=$ROOT/build/robot/images/pelorus-stm32f405-n32
probe=stlink

die() {
    printf 'flash.sh: %s\n' "$*" >&2
    exit 1
}

while [ $# -gt 0 ]; do
    case $1 in
    -h | --help)
        sed -n '3,12s/^# \{0,1\}//p' "$0"
        exit 0
        ;;
    --probe)
        [ $# -ge 2 ] || die '--probe needs stlink, cmsis-dap or jlink'
        probe=$2
        shift 2
        ;;
    -*) die "no option $1: tools/flash.sh [IMAGE] [--probe stlink|cmsis-dap|jlink]" ;;
    *)
        image=${1%.bin}
        image=${image%.elf}
        shift
        ;;
    esac
done
case $probe in
stlink | cmsis-dap | jlink) ;;
*) die "no probe $probe: stlink, cmsis-dap or jlink" ;;
esac
[ -r "$image.bin" ] && [ -r "$image.elf" ] ||
    die "$image.bin or .elf is not there: cmake --build build/robot --target $(basename "$image") makes it"
case $(basename "$image") in
*stm32f405*) target=stm32f4x ;;
*stm32h743*) target=stm32h7x ;;
*) die "$(basename "$image") is not for an STM32F405 or STM32H743; an MPS board takes its image from its SD card" ;;
esac

echo 'Not tried on hardware: watch what happens.'
if [ "$probe" = stlink ] && command -v st-flash >/dev/null; then
    exec st-flash --reset write "$image.bin" "$FLASH_START"
fi
command -v openocd >/dev/null || die 'neither st-flash nor openocd is installed (Debian: stlink-tools, openocd)'
exec openocd -f "interface/$probe.cfg" -f "target/$target.cfg" \
    -c "program $image.elf verify reset exit"
