# SPDX-License-Identifier: MIT
# The desktop replay. Built for the processor family's baseline, not for PELORUS_ARCH: it looks at
# the processor and says what is missing before it calls the library.
function(pelorus_replay name library)
  add_executable(${name} ${PELORUS_POSIX_SOURCES})
  target_link_libraries(${name} PRIVATE ${library})
  target_include_directories(${name} PRIVATE "${PROJECT_SOURCE_DIR}/port")
  target_compile_options(${name} PRIVATE -ffp-contract=off)
  target_compile_definitions(${name} PRIVATE
    _POSIX_C_SOURCE=200809L
    PELORUS_NAME="${name}"
    PELORUS_ARCH="$<$<NOT:$<BOOL:${PLR_PORTABLE}>>:${PELORUS_ARCH}>")
  target_link_libraries(${name} PRIVATE m)
  pelorus_warnings(${name})
endfunction()
