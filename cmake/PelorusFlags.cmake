# SPDX-License-Identifier: MIT
# Compiler flags. They are private and CMake puts them behind the user's own, so that nothing in
# CFLAGS can undo what the equality of bits rests on (docs/NUMERICS.md).
include(CheckCCompilerFlag)

# Flags that let the compiler calculate as if numbers were real. -ffast-math as a whole config.h
# refuses; these are its parts.
string(TOUPPER "${CMAKE_BUILD_TYPE}" pelorus_build_type)
if("${CMAKE_C_FLAGS} ${CMAKE_C_FLAGS_${pelorus_build_type}}" MATCHES
    "(-Ofast|-ffast-math|-funsafe-math-optimizations|-fassociative-math|-freciprocal-math|-ffinite-math-only)")
  message(FATAL_ERROR "Pelorus needs IEEE arithmetic: take ${CMAKE_MATCH_1} out of the C flags.")
endif()

# What the arithmetic rests on.
#   -ffp-contract=off   a*b + c is two roundings unless fused multiply-add is written out
#   -fno-math-errno     sqrt is the processor's instruction; changes no result, only errno
#   -march              the fused multiply-add of float32 kernels is an instruction
# And -O3 where neither a build type nor the user's flags say how to optimise, as in a project that has
# not thought of it: unoptimised, a frame takes twenty times as long.
function(pelorus_arithmetic target)
  target_compile_options(${target} PRIVATE -ffp-contract=off -fno-math-errno)
  if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES AND NOT CMAKE_C_FLAGS MATCHES "(^| )-O")
    target_compile_options(${target} PRIVATE -O3)
  endif()
  if(PELORUS_ARCH AND NOT PLR_PORTABLE)
    check_c_compiler_flag("-march=${PELORUS_ARCH}" PELORUS_HAS_MARCH_${PELORUS_ARCH})
    if(NOT PELORUS_HAS_MARCH_${PELORUS_ARCH})
      message(FATAL_ERROR "${CMAKE_C_COMPILER} does not know -march=${PELORUS_ARCH}. "
        "Set PELORUS_ARCH to one that it knows, or PLR_PORTABLE=ON.")
    endif()
    target_compile_options(${target} PRIVATE "-march=${PELORUS_ARCH}")
  endif()
endfunction()

# The dialect, and every warning that the project holds itself to.
function(pelorus_warnings target)
  set_target_properties(${target} PROPERTIES
    C_STANDARD 99 C_STANDARD_REQUIRED ON C_EXTENSIONS OFF)
  target_compile_options(${target} PRIVATE
    -Wall -Wextra -pedantic -Wconversion -Wdouble-promotion -Wvla -Wshadow -Wmissing-prototypes
    $<$<BOOL:${PELORUS_WERROR}>:-Werror>)
endfunction()
