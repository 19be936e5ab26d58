#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Makes all files of a release in build/release, with SHA256SUMS: wheels for five systems, the
# source distribution, the two files of tools/amalgamate.py, and the firmware of the demo for every
# board, with FIRMWARE.txt; a board that ran neither on hardware nor in an emulator has `untried` in its names. It
# publishes nothing.
#
# usage: tools/release.sh
#
# SYSTEMS='win_amd64' or BOARDS='stm32f405' in the environment: these wheels and boards alone.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/setup.sh"
. "$ROOT/tools/firmware/files.sh"

case ${1-} in
'') ;;
*)
    sed -n '3,10s/^# \{0,1\}//p' "$0"
    exit 0
    ;;
esac

heading 'Set-up'
ensure_packages "${PACKAGES_BUILD[@]}" gcc-arm-none-eabi libnewlib-arm-none-eabi
ensure_python
mkdir -p "$LOGS"
out=$ROOT/build/release
version=$("$VENV/bin/python" -c 'import pelorus; print(pelorus.__version__)')
rm -rf "$out"
mkdir -p "$out"

heading 'Wheels'
PYTHONPATH=$ROOT/tools "$VENV/bin/python" "$ROOT/tools/wheels.py" --out "$out" ${SYSTEMS-}

heading 'Sources'
(cd "$ROOT" && "$VENV/bin/python" -c \
    "from scikit_build_core.build import build_sdist; print(build_sdist('$out'))")
two=$(mktemp -d)
trap 'rm -rf "$two"' EXIT
PYTHONPATH=$ROOT/tools "$VENV/bin/python" "$ROOT/tools/amalgamate.py" "$two"
(cd "$two" && "$VENV/bin/python" -m zipfile -c "$out/pelorus-$version-c.zip" pelorus.h pelorus.c)

heading 'Firmware'
boards=${BOARDS:-$(cd "$ROOT/port/cortex_m/boards" && echo */ | tr -d /)}
images=()
for board in $boards; do
    images+=("pelorus-$board-n32")
done
if ! build_robot "${images[@]}" >"$LOGS/release-build.log" 2>&1; then
    tail -40 "$LOGS/release-build.log"
    die "the build failed: the whole of it is in $LOGS/release-build.log"
fi
copy_images "$out" "$version" $boards

heading 'Done'
cd "$out"
sha256sum -- * >SHA256SUMS
ls -l
