#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Sets up, builds in every way that the project promises, and runs all tests.
#
# usage: tools/test.sh [--quick | --long]
#
#   --quick   one compiler, without sanitizers, portable build and microcontroller
#   --long    adds the tests that take minutes, and draws statistics more than once (PELORUS_LONG=1)
#
# Real recordings are looked for in $PELORUS_DATA, by default ../shared/data; tests that need an
# absent one are skipped, saying so. The last line counts what passed and failed.
set -uo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

extent=normal
for option in "$@"; do
    case $option in
    --quick) extent=quick ;;
    --long) extent=long ;;
    -h | --help)
        sed -n '3,11s/^# \{0,1\}//p' "$0"
        exit 0
        ;;
    *) die "no option $option: tools/test.sh [--quick | --long]" ;;
    esac
done

export PELORUS_DATA=${PELORUS_DATA:-$ROOT/../shared/data}
export PELORUS_LONG=0
[ $extent = long ] && PELORUS_LONG=1
export OPENBLAS_NUM_THREADS=1 # tests run side by side
unset PYTHONDONTWRITEBYTECODE # hundreds of commands are started: each would compile its modules anew
export PYTHONPYCACHEPREFIX=$LOGS/pycache
cd "$ROOT" || exit 1
rm -rf "$LOGS"
mkdir -p "$LOGS"

passed=0 failed=0 skipped=0
failures=() # of each step that failed its name, its log, and why

# count LOG STATUS NAME: adds a step's tests to the totals: those that ctest or pytest counted, else
# the step itself.
count() {
    local log=$1 status=$2 name=$3 good=0 bad=0 total
    if grep -q 'tests passed, .* tests failed out of' "$log"; then
        bad=$(sed -n 's/.*tests passed, \([0-9]*\) tests failed out of.*/\1/p' "$log" | tail -1)
        total=$(sed -n 's/.*tests failed out of \([0-9]*\).*/\1/p' "$log" | tail -1)
        good=$((total - bad))
    elif grep -qE '^=* ?[0-9]+ (passed|failed)' "$log"; then
        good=$(grep -oE '[0-9]+ passed' "$log" | tail -1 | cut -d' ' -f1)
        bad=$(tail -1 "$log" | grep -oE '[0-9]+ (failed|errors?)' | awk '{ n += $1 } END { print n }')
    elif [ "$status" -eq 0 ]; then
        good=1
    fi
    good=${good:-0} bad=${bad:-0}
    [ "$status" -ne 0 ] && [ "$bad" -eq 0 ] && bad=1
    passed=$((passed + good)) failed=$((failed + bad))
    count_skips "$log"
    [ "$status" -eq 0 ] ||
        failures+=("$name (build-logs/$(basename "$log"))"$'\n'"$(reasons "$log" | sed 's/^/    /')")
}

# reasons LOG: the tests that failed and why, in the words of Unity, ctest, pytest, the compilers and the
# scripts; where none of them said anything, the end of the log.
reasons() {
    local said
    said=$(grep -E ':FAIL(:|$)|^(FAILED|ERROR|E  ) |^[[:space:]]+[0-9]+ - .*\((Failed|Timeout|SEGFAULT|Subprocess|Not Run|ILLEGAL|BAD)|error:|Error [0-9]|runtime error|ERROR: ' "$1" |
        awk '!seen[$0]++' | cut -c1-300 | head -60)
    if [ -n "$said" ]; then
        printf '%s\n' "$said"
    else
        tail -10 "$1"
    fi
}

log_of() {
    printf '%s/%s.log' "$LOGS" "$(tr -cs 'A-Za-z0-9\n' '-' <<<"$1")"
}

# told NAME STATUS TIME: shows the end of what a step said, and counts.
told() {
    local name=$1 status=$2 seconds=$3 log
    log=$(log_of "$name")
    heading "$name (build-logs/$(basename "$log"))"
    if [ "$status" -eq 0 ]; then
        tail -3 "$log"
        echo "ok, $seconds s"
    else
        tail -80 "$log"
        echo "FAILED with status $status after $seconds s"
    fi
    count "$log" "$status" "$name"
    return "$status"
}

# step NAME COMMAND...: runs it, and tells.
step() {
    local name=$1 started=$SECONDS
    shift
    "$@" >"$(log_of "$name")" 2>&1
    told "$name" $? $((SECONDS - started))
}

# beside NAME COMMAND...: begins a step that needs one processor, beside others of its kind, JOBS at a
# time; `joined` waits for them all and tells, in the order of their beginning.
begun=()
beside() {
    local name=$1
    shift
    while [ "$(jobs -rp | wc -l)" -ge "$JOBS" ]; do
        wait -n
    done
    begun+=("$name")
    {
        local started=$SECONDS
        "$@" >"$(log_of "$name")" 2>&1
        echo "$? $((SECONDS - started))" >"$(log_of "$name").end"
    } &
}

joined() {
    local name end
    wait
    for name in "${begun[@]}"; do
        read -ra end <"$(log_of "$name").end"
        rm "$(log_of "$name").end"
        told "$name" "${end[@]}"
    done
    begun=()
}

# by_one_job COMMAND...: a build that stands beside others.
by_one_job() {
    local JOBS=1
    "$@"
}

# What tests said when they left something out: Unity's IGNORE lines, pytest's SKIPPED lines and the
# words of the scripts in tests/layering. Shown, and counted.
count_skips() {
    local said
    said=$(grep -hE ':IGNORE|^SKIPPED |^skipped: ' "$1" |
        sed -E 's/^(skipped: |SKIPPED \[[0-9]+\] )//' | sort -u)
    [ -z "$said" ] && return 0
    sed 's/^/skipped: /' <<<"$said"
    skipped=$((skipped + $(wc -l <<<"$said")))
}

skip() {
    heading "$1"
    echo "skipped: $2"
    skipped=$((skipped + 1))
}

run_ctest() {
    ctest --test-dir "$1" --output-on-failure -j "$JOBS" "${@:2}"
    local status=$?
    grep -hE ':IGNORE|^skipped: ' "$1/Testing/Temporary/LastTest.log"
    return $status
}

check_format() {
    find include src port tests tools examples -name '*.[ch]' -print0 |
        xargs -0 clang-format-14 --dry-run --Werror && echo 'every C file is formatted'
}

# fuzz SECONDS PROGRAM CORPUS LENGTH: libFuzzer, from the corpus; new inputs are left in
# build-logs/PROGRAM, and so is one that fails.
fuzz() {
    mkdir -p "$LOGS/$2"
    "build-fuzz/bin/$2" -max_len="$4" -max_total_time="$1" -print_final_stats=1 \
        -artifact_prefix="$LOGS/$2/" "$LOGS/$2" "$3"
}

build_fuzz() {
    cmake -S . -B build-fuzz -DPELORUS_FUZZ=ON -DPELORUS_WERROR=ON -DCMAKE_C_COMPILER="$1" \
        -DPELORUS_BUILD_TESTS=OFF -DPELORUS_BUILD_REPLAY=OFF &&
        cmake --build build-fuzz -j "$JOBS"
}

# Warnings are errors, and the machine must have OpenBLAS: no test is left out in silence.
strict=(-DPELORUS_BUILD_TESTS=ON -DPELORUS_WERROR=ON -DPELORUS_REQUIRE_ORACLE=ON
    -DPELORUS_LONG_TESTS=$([ $extent = long ] && echo ON || echo OFF))
if command -v ld.gold >/dev/null; then # of three hundred programs a build: a third of the usual one's time
    strict+=(-DCMAKE_EXE_LINKER_FLAGS=-fuse-ld=gold)
fi

heading 'Set-up'
[ $extent = long ] && PACKAGES_WANTED+=(libclang-rt-14-dev) # libFuzzer
if [ $extent = quick ]; then
    ensure_packages "${PACKAGES_BUILD[@]}" g++ libopenblas-dev liblapacke-dev
else
    ensure_packages "${PACKAGES_BUILD[@]}" "${PACKAGES_TEST[@]}" "${PACKAGES_WANTED[@]/%/?}"
fi
prefer_ninja
if [ -d "$PELORUS_DATA" ]; then
    echo "real recordings: $PELORUS_DATA"
else
    echo "skipped: no real recordings at $PELORUS_DATA; tests that need them say so"
fi

# --- what needs no Python, beside its environment -------------------------------------------------

if [ $extent != quick ]; then
    clang=$(command -v clang-14 || command -v clang)
    replays=(-DPELORUS_BUILD_TESTS=OFF -DPELORUS_WERROR=ON)
    beside 'Python environment' ensure_python
    # Another compiler and less optimised: in one build, and by gcc, too, with --long.
    builds=(build build-clang build-portable)
    level=2
    if [ $extent = long ]; then
        level=3
        builds+=(build-o2)
        beside 'build: less optimised' by_one_job build_replays o2 "${replays[@]}"
    fi
    beside 'build: clang' by_one_job build_replays clang "${replays[@]}" -DCMAKE_C_COMPILER="$clang" \
        "-DCMAKE_C_FLAGS_RELEASE=-O$level -DNDEBUG"
    joined
fi
ensure_python # there by now; if not, it says why and ends this

# --- form, beside the first build -----------------------------------------------------------------

beside 'Python types' "$VENV/bin/mypy" --config-file tools/pyproject.toml \
    tools/pelorus tools/course/pelorus_course tools/firmware tools/*.py port/ros2/pelorus_ros/pelorus_ros/[!n]*.py tests/python tests/layering tests/golden tests/fuzz tests/independent \
    tests/recordings examples/*.py
beside 'Python types, tests on boards' env MYPYPATH=tools:tests/python "$VENV/bin/mypy" \
    --config-file tools/pyproject.toml --cache-dir .mypy_cache/boards tests/target
beside 'Python format' "$VENV/bin/ruff" format --check --config tools/pyproject.toml tools tests port examples
beside 'Python lint' "$VENV/bin/ruff" check --config tools/pyproject.toml tools tests port examples
if command -v clang-format-14 >/dev/null; then
    beside 'C format' check_format
else
    skip 'C format' 'clang-format-14 is not here'
fi

# --- the desktop ---------------------------------------------------------------------------------

# Compiles the tests, and finds them, once: else each of pytest's processes would, at the same time.
beside 'Python tests, found' "$VENV/bin/python" -m pytest -q --collect-only tests/python

step 'build: gcc' build_preset release "${strict[@]}"
built=$?
joined
[ $built -eq 0 ] && step 'test: gcc' run_ctest build
[ $extent = long ] && beside 'ROS 2 node' tools/ros2.sh # its environment and its tests take five minutes
step 'test: Python' env CI=true "$VENV/bin/python" -m pytest -q -rfEs -n "$JOBS" --dist worksteal \
    tests/python

if [ $extent != quick ]; then
    # Beside the builds and tests that follow: some tests on emulated boards wait for silence.
    beside 'microcontroller' tests/target/run.sh
    # One of each kind; to run all of them, or to link for those that cannot run here, takes minutes.
    if [ $extent = long ]; then
        beside 'same bits on other systems' "$VENV/bin/python" tools/cross.py
    else
        beside 'same bits on other systems' "$VENV/bin/python" tools/cross.py linux-aarch64 wasi-relaxed
        beside 'compiles for other systems' "$VENV/bin/python" tools/cross.py --compile-only windows-x86_64 macos-aarch64
    fi

    # Of these two nothing is installed, and no library built that nothing links. Memory and undefined
    # behaviour are the same source in float64: its tests are built with --long, and one with other blocks always.
    # A folder keeps what it was told last, so each option is told either way.
    reals=(-DPELORUS_TEST_REALS=f32 -DPELORUS_TESTS_ALONE=ON)
    [ $extent = long ] && reals=('-DPELORUS_TEST_REALS=f32;f64' -DPELORUS_TESTS_ALONE=OFF)
    step 'build: sanitizers' build_preset debug "${strict[@]}" -DPELORUS_INSTALL=OFF "${reals[@]}" &&
        step 'test: sanitizers' run_ctest build-debug --label-exclude sources # they are the same sources
    # Another compiler, and without a fused multiply-add instruction. Where the golden tests and the units
    # compute the same bits, so would the long drives: they are built with --long alone, for their warnings. So
    # are the programs that nothing runs and libraries that check themselves, which gcc's two builds do.
    kinds=('-DPELORUS_TEST_KINDS=unit;golden' -DPELORUS_TESTS_ALONE=ON -DPELORUS_TEST_ASSERTIONS=OFF)
    [ $extent = long ] &&
        kinds=('-DPELORUS_TEST_KINDS=unit;property;golden;regression;fuzz;campaign' -DPELORUS_TESTS_ALONE=OFF
            -DPELORUS_TEST_ASSERTIONS=ON)
    step 'build: clang, portable' build_preset portable "${strict[@]}" -DPELORUS_INSTALL=OFF \
        -DPELORUS_TEST_BLOCKS=OFF "${kinds[@]}" -DCMAKE_C_COMPILER="$clang" &&
        step 'test: clang, portable' run_ctest build-portable --label-regex '^(unit|golden|symbols)$'
    step 'same bits from every build' "$VENV/bin/python" tests/golden/same_bits.py "${builds[@]}"
    if [ $extent = long ] && step 'build: libFuzzer' build_fuzz "$clang"; then
        step 'fuzz the reader' fuzz 120 fuzz_reader tests/fuzz/corpus 4096
        step 'fuzz the session' fuzz 300 fuzz_session tests/fuzz/corpus_session 8192
    fi
    joined
fi

# --- summary -------------------------------------------------------------------------------------

heading "Summary, after $((SECONDS / 60)) min $((SECONDS % 60)) s"
for failure in "${failures[@]+"${failures[@]}"}"; do
    echo "failed: $failure"
done
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
