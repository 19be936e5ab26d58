# SPDX-License-Identifier: MIT
# shellcheck shell=bash
# What tools/demo.sh and tools/test.sh share: installing what is missing, the Python environment,
# building. Sourced, not run. Works on Debian 12 and Ubuntu 24.04 or later; elsewhere it names what
# is missing and stops.

ROOT=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
VENV=$ROOT/.venv
LOGS=$ROOT/build-logs
JOBS=${JOBS:-2}
export PIP_DISABLE_PIP_VERSION_CHECK=1

# Packages by Debian name; a|b: the first one that is installed or can be had.
PACKAGES_BUILD=(gcc libc6-dev make cmake python3 python3-venv ca-certificates)
PACKAGES_TEST=(g++ 'clang-14|clang' libopenblas-dev liblapacke-dev
    gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm)
# Without these a check is skipped, saying so; without ninja builds take longer.
PACKAGES_WANTED=(clang-format-14 libzstd-dev ninja-build pkg-config qemu-user-static valgrind)

heading() {
    printf '\n=== %s\n' "$*"
}

die() {
    printf '%s: %s\n' "$(basename "$0")" "$*" >&2
    exit 1
}

# --- packages ------------------------------------------------------------------------------------

package_installed() {
    [ "$(dpkg-query -W -f='${db:Status-Status}' "$1" 2>/dev/null)" = installed ]
}

any_installed() {
    local name
    for name in ${1//|/ }; do
        package_installed "$name" && return 0
    done
    return 1
}

as_root() {
    if [ "$(id -u)" -eq 0 ]; then
        "$@"
    else
        sudo "$@"
    fi
}

# The first of a|b|c that apt knows.
first_available() {
    local name
    for name in ${1//|/ }; do
        if [ -n "$(apt-cache policy "$name" 2>/dev/null | grep 'Candidate: [^(]')" ]; then
            printf '%s\n' "$name"
            return 0
        fi
    done
    return 1
}

# ensure_packages WORD...: installs what is missing. A word that ends in ? may stay missing.
ensure_packages() {
    local word name wanted=() install=()
    command -v dpkg-query >/dev/null && command -v apt-get >/dev/null ||
        { note_foreign_system "$@" && return 0; }
    for word in "$@"; do
        any_installed "${word%\?}" || wanted+=("$word")
    done
    [ ${#wanted[@]} -eq 0 ] && { echo 'Debian packages: all present'; return 0; }

    echo "Debian packages missing: ${wanted[*]}"
    [ "$(id -u)" -eq 0 ] || command -v sudo >/dev/null ||
        die 'neither root nor sudo: ask whoever may to apt-get install these packages'
    as_root apt-get update -qq || die 'apt-get update failed: is there a network?'
    for word in "${wanted[@]}"; do
        if name=$(first_available "${word%\?}"); then
            install+=("$name")
        elif [ "$word" = "${word%\?}" ]; then
            die "apt knows no package $word"
        else
            echo "not to be had here: ${word%\?}"
        fi
    done
    [ ${#install[@]} -eq 0 ] && return 0
    echo "installing: ${install[*]}"
    as_root env DEBIAN_FRONTEND=noninteractive \
        apt-get install -y -qq --no-install-recommends "${install[@]}" >/dev/null ||
        die "apt-get install ${install[*]} failed"
}

note_foreign_system() {
    echo "No apt here. Needed, by their Debian names: $*"
    local tool
    for tool in cc make cmake python3; do
        command -v "$tool" >/dev/null || die "no $tool: install it first"
    done
}

# --- Python --------------------------------------------------------------------------------------

# ensure_python: the command pelorus and its development tools, pinned, in .venv.
ensure_python() {
    local lock=$ROOT/tools/requirements.lock stamp=$VENV/pelorus-installed-from
    local wanted
    python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
        die "Python $(python3 -V 2>&1 | cut -d' ' -f2) is too old: 3.11 or later is needed"
    wanted="$ROOT $(python3 -V) $(cat "$lock" "$ROOT/pyproject.toml" "$ROOT/tools/course/pyproject.toml" | sha256sum)"
    if [ "$(cat "$stamp" 2>/dev/null)" = "$wanted" ]; then
        echo 'Python environment: up to date'
        return 0
    fi
    echo "Python environment: installing $(grep -c '^[a-zA-Z].*==' "$lock") pinned packages into .venv"
    rm -rf "$VENV"
    python3 -m venv "$VENV" || die 'python3 -m venv failed: install python3-venv'
    # Python compiles a module when it is first imported; most of what is here never is.
    "$VENV/bin/python" -m pip install --quiet --no-compile --requirement "$lock" ||
        die 'pip could not install tools/requirements.lock: is there a network?'
    # The sources as they are, without the library: that one comes from build/bin.
    "$VENV/bin/python" -m pip install --quiet --no-deps --no-build-isolation \
        --config-settings=wheel.cmake=false --config-settings=editable.mode=inplace --editable "$ROOT" --editable "$ROOT/tools/course" ||
        die 'pip could not install the tools'
    printf '%s' "$wanted" >"$stamp"
}

# --- building ------------------------------------------------------------------------------------

# prefer_ninja: it needs a sixth less time than make for hundreds of small targets. A folder that has been
# configured keeps its generator.
prefer_ninja() {
    if command -v ninja >/dev/null; then
        export CMAKE_GENERATOR=Ninja
    fi
}

# build_preset NAME [CMAKE OPTION...]: configures and builds, in the preset's own folder.
build_preset() {
    local preset=$1
    shift
    (cd "$ROOT" &&
        cmake --preset "$preset" -DPython3_EXECUTABLE="$VENV/bin/python" "$@" &&
        cmake --build --preset "$preset" -j "$JOBS")
}

# build_desktop: what the tools need of build/. A folder that was configured with tests keeps them, and its other
# options: ctest would run old programs there otherwise.
build_desktop() {
    local options=()
    grep -qs '^PELORUS_BUILD_TESTS:BOOL=ON' "$ROOT/build/CMakeCache.txt" ||
        options=(-DPELORUS_BUILD_TESTS=OFF -DPELORUS_WERROR=OFF)
    (cd "$ROOT" &&
        cmake --preset release -DPython3_EXECUTABLE="$VENV/bin/python" "${options[@]+"${options[@]}"}" &&
        cmake --build --preset release -j "$JOBS" \
            --target pelorus-replay pelorus-replay-f64 pelorus-filter pelorus-filter-f64)
}

# build_replays NAME [CMAKE OPTION...]: of a preset pelorus-replay and pelorus-replay-f64 alone.
build_replays() {
    local preset=$1
    shift
    (cd "$ROOT" && cmake --preset "$preset" "$@" &&
        cmake --build --preset "$preset" -j "$JOBS" --target pelorus-replay pelorus-replay-f64)
}

# emulated_ccm: where the emulated stm32f405 has its second memory. QEMU before 8.0 has 192 KB in one piece.
emulated_ccm() {
    case $(qemu-system-arm --version 2>/dev/null | grep -oE '[0-9]+' | head -1) in
    [1-7]) echo 0x20020000 ;;
    *) echo 0x10000000 ;;
    esac
}

# build_robot TARGET...: firmware, in build/robot. Images of every one of $CAPACITIES, and the bench images
# that docs/SIZES.md is measured on (target bench), come out of one build: each library is compiled once.
ROBOT=$ROOT/build/robot
CAPACITIES=${CAPACITIES:-8 16 32 64}
build_robot() {
    local options=()
    mkdir -p "$ROBOT"
    case " $* " in *' bench '*)
        PYTHONPATH=$ROOT/tools "$VENV/bin/python" -m firmware.sizes recordings "$ROBOT" || return 1
        options=("-DPELORUS_CAPACITIES=${CAPACITIES// /;}" "-DPELORUS_BENCH_RECORDINGS=$ROBOT/twist.plr;$ROBOT/imu.plr")
        ;;
    esac
    case " $* " in *' eyes-replay-'*)
        mkdir -p "$ROBOT/pictures"
        PELORUS_BIN=$ROOT/build/bin PYTHONPATH=$ROOT/tools "$VENV/bin/python" -m firmware.pictures \
            "$ROBOT/pictures" || return 1
        options+=("-DPELORUS_EYES_RECORDINGS=$ROBOT/pictures" "-DPELORUS_CCM_ORIGIN=$(emulated_ccm)")
        ;;
    esac
    cmake -S "$ROOT/port/cortex_m" -B "$ROBOT" -DCMAKE_BUILD_TYPE=None \
        --toolchain "$ROOT/port/cortex_m/toolchain.cmake" -DPELORUS_MAVLINK=ON \
        -DPython3_EXECUTABLE="$VENV/bin/python" "${options[@]+"${options[@]}"}" &&
        cmake --build "$ROBOT" -j "$JOBS" --target "$@"
}
