# SPDX-License-Identifier: MIT
# The desktop replay. Built for the processor family's baseline, not for PELORUS_ARCH: it looks at
# the processor and says what is missing before it calls the library.

# pelorus_replay(NAME LIBRARY): the program, and NAME-parts, all of it but main, for the tests.
function(pelorus_replay name library)
  set(parts ${PELORUS_POSIX_SOURCES})
  list(FILTER parts EXCLUDE REGEX "/main\\.c$")
  add_library(${name}-parts STATIC ${parts})
  target_include_directories(${name}-parts PUBLIC "${PROJECT_SOURCE_DIR}/port")
  target_link_libraries(${name}-parts PUBLIC ${library} m)
  add_executable(${name} "${PROJECT_SOURCE_DIR}/port/posix/main.c")
  target_link_libraries(${name} PRIVATE ${name}-parts)
  foreach(target ${name}-parts ${name})
    target_compile_options(${target} PRIVATE -ffp-contract=off)
    target_compile_definitions(${target} PRIVATE
      _POSIX_C_SOURCE=200809L
      PELORUS_NAME="${name}"
      PELORUS_ARCH="$<$<NOT:$<BOOL:${PLR_PORTABLE}>>:${PELORUS_ARCH}>")
    pelorus_warnings(${target})
  endforeach()
endfunction()
