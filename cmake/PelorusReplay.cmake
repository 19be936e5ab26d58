# SPDX-License-Identifier: MIT
# The desktop replay. Built for the processor family's baseline, not for PELORUS_ARCH: it looks at
# the processor and says what is missing before it calls the library (port/posix/processor.c).

# Compressed recordings, where libzstd is: chosen by file.
find_path(PELORUS_ZSTD_INCLUDE zstd.h)
find_library(PELORUS_ZSTD_LIBRARY zstd)
if(PELORUS_ZSTD AND PELORUS_ZSTD_INCLUDE AND PELORUS_ZSTD_LIBRARY)
  list(FILTER PELORUS_POSIX_SOURCES EXCLUDE REGEX "/compressed_none\\.c$")
else()
  message(STATUS "Without libzstd: .plr.zst are not read or written "
    "(on Debian and Ubuntu: apt-get install libzstd-dev)")
  list(FILTER PELORUS_POSIX_SOURCES EXCLUDE REGEX "/compressed_zstd\\.c$")
  set(PELORUS_ZSTD_LIBRARY "")
endif()

if(PLR_VISION)
  list(FILTER PELORUS_POSIX_SOURCES EXCLUDE REGEX "/pictures_none\\.c$")
else()
  list(FILTER PELORUS_POSIX_SOURCES EXCLUDE REGEX "/pictures\\.c$")
endif()

if(WIN32)
  list(FILTER PELORUS_POSIX_SOURCES EXCLUDE REGEX "/system_posix\\.c$")
else()
  list(FILTER PELORUS_POSIX_SOURCES EXCLUDE REGEX "/system_windows\\.c$")
endif()

# pelorus_replay(NAME LIBRARY): the program, and NAME-parts, all of it but main, for the tests.
function(pelorus_replay name library)
  set(parts ${PELORUS_POSIX_SOURCES})
  list(FILTER parts EXCLUDE REGEX "/main\\.c$")
  add_library(${name}-parts STATIC ${parts})
  target_include_directories(${name}-parts PUBLIC "${PROJECT_SOURCE_DIR}/port")
  target_link_libraries(${name}-parts PUBLIC ${library} ${PELORUS_ZSTD_LIBRARY} m)
  add_executable(${name} "${PROJECT_SOURCE_DIR}/port/posix/main.c")
  target_link_libraries(${name} PRIVATE ${name}-parts)
  foreach(target ${name}-parts ${name})
    target_compile_options(${target} PRIVATE -ffp-contract=off)
    target_compile_definitions(${target} PRIVATE
      _XOPEN_SOURCE=700
      PELORUS_NAME="${name}"
      PELORUS_ARCH="$<$<NOT:$<BOOL:${PLR_PORTABLE}>>:${PELORUS_ARCH}>")
    pelorus_warnings(${target})
  endforeach()
endfunction()
