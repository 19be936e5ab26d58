#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Measures what the filter costs on each board (flash, RAM, stack, instructions) and writes
# docs/SIZES.md.
#
# usage: tools/sizes.sh [--check]
#
#   --check   measures, and compares with docs/SIZES.md instead of writing it; with CAPACITIES='8 32'
#             in the environment these alone
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

action=write
case ${1-} in
'') ;;
--check) action=check ;;
-h | --help)
    sed -n '3,9s/^# \{0,1\}//p' "$0"
    exit 0
    ;;
*) die "no option $1: tools/sizes.sh [--check]" ;;
esac

heading 'Set-up'
ensure_packages "${PACKAGES_BUILD[@]}" gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm
ensure_python
mkdir -p "$LOGS"

heading 'Building every board with every capacity (build/robot)'
if ! build_robot boards bench >"$LOGS/sizes-build.log" 2>&1; then
    tail -40 "$LOGS/sizes-build.log"
    die "the build failed: the whole of it is in $LOGS/sizes-build.log"
fi

heading 'Measuring under QEMU'
PYTHONPATH=$ROOT/tools "$VENV/bin/python" -m firmware.sizes "$action" "$ROBOT" "$ROOT/docs/SIZES.md" $CAPACITIES
[ "$action" = check ] || echo 'docs/SIZES.md'
