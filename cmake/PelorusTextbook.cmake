# SPDX-License-Identifier: MIT
# The textbook filter on OpenBLAS and LAPACKE: a library that the tests hold `world` against, and the
# program pelorus-textbook, which is the replay with that filter in the place of the library's.

# Settings and vocabulary are the library's, and so are its public headers; nothing of src/filter is.
add_library(pelorus-textbook-filter STATIC
  "${PROJECT_SOURCE_DIR}/textbook/se3.c"
  "${PROJECT_SOURCE_DIR}/textbook/state.c"
  "${PROJECT_SOURCE_DIR}/textbook/predict.c"
  "${PROJECT_SOURCE_DIR}/textbook/observe.c"
  "${PROJECT_SOURCE_DIR}/textbook/update.c"
  "${PROJECT_SOURCE_DIR}/textbook/landmarks.c")
target_include_directories(pelorus-textbook-filter PUBLIC
  "${PROJECT_SOURCE_DIR}" "${PROJECT_SOURCE_DIR}/include")
target_link_libraries(pelorus-textbook-filter PUBLIC pelorus_blas m)
target_compile_options(pelorus-textbook-filter PRIVATE -ffp-contract=off)
pelorus_warnings(pelorus-textbook-filter)

if(NOT PELORUS_POSIX_SOURCES)
  return()
endif()

# The program: wire, session and replay as they are, settings and texts of the filter, and plr_filter_*
# from textbook/ in the place of src/filter.
file(GLOB pelorus_textbook_session CONFIGURE_DEPENDS
  "${PROJECT_SOURCE_DIR}/src/session/*.c" "${PROJECT_SOURCE_DIR}/src/wire/*.c")
set(pelorus_textbook_posix ${PELORUS_POSIX_SOURCES})
list(FILTER pelorus_textbook_posix EXCLUDE REGEX "/(main|program)\\.c$")
add_executable(pelorus-textbook
  "${PROJECT_SOURCE_DIR}/textbook/main.c"
  "${PROJECT_SOURCE_DIR}/textbook/program.c"
  "${PROJECT_SOURCE_DIR}/textbook/census.c"
  "${PROJECT_SOURCE_DIR}/textbook/memory.c"
  "${PROJECT_SOURCE_DIR}/textbook/filter.c"
  "${PROJECT_SOURCE_DIR}/textbook/frame.c"
  "${PROJECT_SOURCE_DIR}/textbook/estimate.c"
  "${PROJECT_SOURCE_DIR}/src/filter/settings.c"
  "${PROJECT_SOURCE_DIR}/src/filter/status.c"
  ${pelorus_textbook_session} ${pelorus_textbook_posix})
target_include_directories(pelorus-textbook PRIVATE
  "${PROJECT_SOURCE_DIR}/src" "${PROJECT_SOURCE_DIR}/port")
target_link_libraries(pelorus-textbook PRIVATE
  pelorus-textbook-filter ${PELORUS_ZSTD_LIBRARY} m)
target_compile_options(pelorus-textbook PRIVATE -ffp-contract=off)
target_compile_definitions(pelorus-textbook PRIVATE
  _POSIX_C_SOURCE=200809L
  PELORUS_NAME="pelorus-textbook"
  PELORUS_ARCH=""
  PLR_REAL=64 PLR_PORTABLE=0
  PLR_MAX_LANDMARKS=${PELORUS_DESKTOP_LANDMARKS}
  PLR_MAX_OBSERVATIONS=${PELORUS_DESKTOP_OBSERVATIONS}
  PLR_BLOCK_OBSERVATIONS=${PLR_BLOCK_OBSERVATIONS})
pelorus_warnings(pelorus-textbook)
