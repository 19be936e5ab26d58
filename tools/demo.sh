#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Shows the filter at work: sets up, builds, replays a recording, draws the report.
#
# usage: tools/demo.sh [RECORDING.plr]
#
# Without a recording it makes one, a simulated drive through a landmark field. Everything it
# produces is left in out/.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

case ${1-} in
-h | --help)
    sed -n '3,9s/^# \{0,1\}//p' "$0"
    exit 0
    ;;
-*) die "no option $1: tools/demo.sh [RECORDING.plr]" ;;
esac
[ $# -le 1 ] || die "one recording at most, not $#: tools/demo.sh [RECORDING.plr]"
recording=${1-}
[ -z "$recording" ] || [ -r "$recording" ] || die "$recording: cannot be read"
[ -z "$recording" ] || recording=$(realpath "$recording")

heading 'Set-up'
ensure_packages "${PACKAGES_BUILD[@]}"
ensure_python

heading 'Building (build/)'
mkdir -p "$LOGS"
if ! build_desktop >"$LOGS/demo-build.log" 2>&1; then
    tail -40 "$LOGS/demo-build.log"
    die "the build failed: the whole of it is in $LOGS/demo-build.log"
fi
echo 'build/bin/pelorus-replay, build/bin/pelorus-replay-f64'

cd "$ROOT"
mkdir -p out
if [ -z "$recording" ]; then
    heading 'Simulating a drive'
    recording=$ROOT/out/demo.plr
    "$VENV/bin/pelorus" simulate "$recording" --force
fi

heading 'Replaying it (float32, what the robot runs)'
build/bin/pelorus-replay "$recording" --trajectory out/trajectory.tum --out out/log.plr --force
"$VENV/bin/pelorus" export out/log.plr --map out/map.ply --force

heading 'Drawing the report'
"$VENV/bin/pelorus" report "$recording" --out out --force

heading 'Done'
echo 'Report: out/report.html. Its pictures:'
find out -maxdepth 1 -name '*.png' -newer "$LOGS/demo-build.log" | sort | sed 's/^/  /'
echo 'Estimated path and map: out/trajectory.tum, out/map.ply'
