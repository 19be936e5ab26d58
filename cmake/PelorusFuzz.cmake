# SPDX-License-Identifier: MIT
# libFuzzer programs, in float32, with the address and undefined-behaviour sanitizers:
#
#   cmake -S . -B build-fuzz -DPELORUS_FUZZ=ON -DCMAKE_C_COMPILER=clang-14
#   cmake --build build-fuzz -j2
#   build-fuzz/bin/fuzz_reader -max_len=4096 found tests/fuzz/corpus
include(CheckCSourceCompiles)

if(NOT CMAKE_C_COMPILER_ID MATCHES "Clang")
  message(FATAL_ERROR "PELORUS_FUZZ needs libFuzzer, which is clang's; this is "
    "${CMAKE_C_COMPILER_ID} (${CMAKE_C_COMPILER}). In a folder of its own: "
    "cmake -S . -B build-fuzz -DPELORUS_FUZZ=ON -DCMAKE_C_COMPILER=clang-14")
endif()

set(pelorus_fuzz_flags -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=all)
set(CMAKE_REQUIRED_FLAGS "-fsanitize=fuzzer,address,undefined")
check_c_source_compiles([[
  #include <stddef.h>
  #include <stdint.h>
  int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) { (void)data; return (int)(size & 0); }
]] PELORUS_HAS_LIBFUZZER)
unset(CMAKE_REQUIRED_FLAGS)
if(NOT PELORUS_HAS_LIBFUZZER)
  message(FATAL_ERROR "${CMAKE_C_COMPILER} cannot link -fsanitize=fuzzer: its runtime is missing "
    "(on Debian and Ubuntu: apt-get install libclang-rt-14-dev).")
endif()

# The library is compiled in, so that libFuzzer sees which of its branches an input reaches. It has
# little room: evicting and refusing for want of it are within reach of short inputs, and runs are
# fast.
function(pelorus_fuzz_program name)
  add_executable(${name} "${PROJECT_SOURCE_DIR}/tests/fuzz/${name}.c"
    "${PROJECT_SOURCE_DIR}/tests/support/assertions.c" ${PELORUS_SOURCES})
  target_include_directories(${name} PRIVATE
    "${PROJECT_SOURCE_DIR}/include" "${PROJECT_SOURCE_DIR}/src" "${PROJECT_SOURCE_DIR}/tests")
  target_compile_definitions(${name} PRIVATE
    PLR_ASSERTIONS=1 PLR_REAL=32 PLR_MAX_LANDMARKS=12 PLR_MAX_OBSERVATIONS=32
    PLR_BLOCK_OBSERVATIONS=${PLR_BLOCK_OBSERVATIONS} PLR_PORTABLE=$<BOOL:${PLR_PORTABLE}>)
  pelorus_arithmetic(${name})
  pelorus_warnings(${name})
  target_compile_options(${name} PRIVATE ${pelorus_fuzz_flags} -g -O1 -fno-omit-frame-pointer)
  target_link_options(${name} PRIVATE ${pelorus_fuzz_flags})
endfunction()

pelorus_fuzz_program(fuzz_reader)
pelorus_fuzz_program(fuzz_session)
