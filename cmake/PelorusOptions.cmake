# SPDX-License-Identifier: MIT
# Everything that a user may choose.

# Of the library, as include/pelorus/config.h has them.
set(PLR_MAX_LANDMARKS 32 CACHE STRING "Most landmarks a filter can hold, 1 to 1024")
set(PLR_MAX_OBSERVATIONS 128 CACHE STRING "Most observations in one frame, 1 to 4096")
# Of pelorus-replay, the tests and the bench.
set(PELORUS_DESKTOP_LANDMARKS 256 CACHE STRING "Most landmarks of pelorus-replay, 1 to 1024")
set(PELORUS_DESKTOP_OBSERVATIONS 1024 CACHE STRING
  "Most observations in one frame of pelorus-replay, 1 to 4096")
set(PLR_BLOCK_OBSERVATIONS 8 CACHE STRING
  "Observations processed at once, 1 to 16; results depend on it in their last bits")
set(PLR_MAX_CALIBRATION 5 CACHE STRING
  "Most numbers of the calibration that can be estimated, 0 to 11; on the desk 11")
option(PLR_SUPERVISE "With src/supervise; OFF: the estimator alone, for who has a supervisor of his own" ON)
option(PLR_KNOWN_MAP "With src/known_map; OFF: known-map and localization are refused" ON)
option(PLR_VISION "With src/vision, which follows points through pictures; OFF: the tracker is somebody else's" ON)
set(PLR_VISION_PIXELS 76800 CACHE STRING "Most pixels of a picture, 2304 to 16777216")
set(PLR_VISION_TRACKS 50 CACHE STRING "Most points that are followed in pictures, 1 to 1024")
set(PLR_VISION_LEVELS 4 CACHE STRING "Most levels of a picture's pyramid, 1 to 6; results depend on it")
set(PELORUS_DESKTOP_PIXELS 3145728 CACHE STRING "Most pixels of a picture at the desk")
set(PELORUS_DESKTOP_TRACKS 400 CACHE STRING "Most points that are followed at the desk, 1 to 1024")
option(PLR_PORTABLE
  "Exact fused multiply-add in software: runs on any processor, slower, the same bits" OFF)

# float32 kernels need the fused multiply-add of x86-64-v3 (2013 and later). On other processors the
# compiler's own choice is left alone.
if(CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64|amd64)$")
  set(pelorus_default_arch x86-64-v3)
else()
  set(pelorus_default_arch "")
endif()
set(PELORUS_ARCH "${pelorus_default_arch}" CACHE STRING
  "-march of the library: x86-64-v3, native, ...; empty: the compiler's; unused if PLR_PORTABLE")

option(PLR_ASSERTIONS "Every library checks its own assumptions, as the tests' libraries always do; the same bits"
  OFF)

# CMake 3.21's PROJECT_IS_TOP_LEVEL: inside another project only the library is wanted.
option(PELORUS_BUILD_REPLAY "Build pelorus-replay" ${PROJECT_IS_TOP_LEVEL})
option(PELORUS_BUILD_TESTS "Build the tests and benches" ${PROJECT_IS_TOP_LEVEL})
option(PELORUS_PYTHON "Install what the Python package holds, and nothing else (pip does)" OFF)
if(PELORUS_PYTHON)
  set(PELORUS_BUILD_TESTS OFF)
  set(PELORUS_INSTALL OFF)
endif()
if(PELORUS_BUILD_TESTS OR (PELORUS_BUILD_REPLAY AND NOT PELORUS_PYTHON))
  set(PELORUS_BUILD_TEXTBOOK ON)
endif()
option(PELORUS_TESTS_ALONE "Build no program that no test of this build runs: bench, textbook" OFF)
option(PELORUS_TEST_ASSERTIONS "The tests link libraries that check their own assumptions" ON)
option(PELORUS_ZSTD "pelorus-replay reads and writes .plr.zst, if libzstd is here" ON)
option(PELORUS_INSTALL "Make install rules" ${PROJECT_IS_TOP_LEVEL})
option(PELORUS_WERROR "Take warnings as errors (the project's own tests do)" OFF)
option(PELORUS_REQUIRE_ORACLE "Stop if OpenBLAS or LAPACKE is missing, instead of testing against plain loops"
  OFF)
option(PELORUS_FUZZ "Build the libFuzzer programs (clang only)" OFF)
set(PELORUS_DEPS_DIR "${PROJECT_BINARY_DIR}/deps" CACHE PATH
  "Where the test framework is kept once fetched; share it between build folders")

if(PROJECT_IS_TOP_LEVEL)
  if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
    set(CMAKE_BUILD_TYPE Release CACHE STRING "Release, Debug, RelWithDebInfo" FORCE)
  endif()
  set(CMAKE_RUNTIME_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/bin")
  set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
endif()
