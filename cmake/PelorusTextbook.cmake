# SPDX-License-Identifier: MIT
# The textbook filter: a library that the tests hold whole frames against, on OpenBLAS and LAPACKE or,
# slower, on plain loops; and where there is OpenBLAS the program pelorus-textbook, which is the replay
# with that filter in the place of the library's.
set(pelorus_textbook_dir "${PROJECT_SOURCE_DIR}/tests/textbook")
set(pelorus_oracle_dir "${PROJECT_SOURCE_DIR}/tests/support")

# Settings and vocabulary are the library's, and so are its public headers; nothing of src/filter is.
add_library(pelorus-textbook-filter STATIC
  "${pelorus_textbook_dir}/state.c"
  "${pelorus_textbook_dir}/transport.c"
  "${pelorus_textbook_dir}/predict.c"
  "${pelorus_textbook_dir}/observe.c"
  "${pelorus_textbook_dir}/search.c"
  "${pelorus_textbook_dir}/body.c"
  "${pelorus_textbook_dir}/update.c"
  "${pelorus_textbook_dir}/consider.c"
  "${pelorus_textbook_dir}/landmarks.c"
  "${pelorus_oracle_dir}/rigid.c"
  "${pelorus_oracle_dir}/oracle.c"
  "${pelorus_oracle_dir}/plain_algebra.c"
  "${pelorus_oracle_dir}/oracle_$<IF:$<TARGET_EXISTS:pelorus_blas>,blas,plain>.c")
target_include_directories(pelorus-textbook-filter PUBLIC
  "${PROJECT_SOURCE_DIR}/tests" "${PROJECT_SOURCE_DIR}/include")
target_link_libraries(pelorus-textbook-filter PUBLIC m)
if(TARGET pelorus_blas)
  target_link_libraries(pelorus-textbook-filter PUBLIC pelorus_blas)
endif()
target_compile_options(pelorus-textbook-filter PRIVATE -ffp-contract=off)
pelorus_warnings(pelorus-textbook-filter)

if(NOT PELORUS_POSIX_SOURCES OR NOT TARGET pelorus_blas)
  return()
endif()

# The program: wire, session and replay as they are, settings and texts of the filter, and plr_filter_*
# from tests/textbook in the place of src/filter.
file(GLOB pelorus_textbook_session CONFIGURE_DEPENDS
  "${PROJECT_SOURCE_DIR}/src/session/*.c" "${PROJECT_SOURCE_DIR}/src/record/*.c")
set(pelorus_textbook_posix ${PELORUS_POSIX_SOURCES})
list(FILTER pelorus_textbook_posix EXCLUDE REGEX "/(main|program|pictures|pictures_none)\\.c$")
list(APPEND pelorus_textbook_posix "${PROJECT_SOURCE_DIR}/port/posix/pictures_none.c")
add_executable(pelorus-textbook
  "${pelorus_textbook_dir}/main.c"
  "${pelorus_textbook_dir}/program.c"
  "${pelorus_textbook_dir}/census.c"
  "${pelorus_textbook_dir}/memory.c"
  "${pelorus_textbook_dir}/filter.c"
  "${pelorus_textbook_dir}/frame.c"
  "${pelorus_textbook_dir}/estimate.c"
  "${PROJECT_SOURCE_DIR}/src/math/finite.c"
  ${pelorus_textbook_session} ${pelorus_textbook_posix})
target_include_directories(pelorus-textbook PRIVATE
  "${PROJECT_SOURCE_DIR}/src" "${PROJECT_SOURCE_DIR}/port")
target_link_libraries(pelorus-textbook PRIVATE
  pelorus-textbook-filter ${PELORUS_ZSTD_LIBRARY} m)
target_compile_options(pelorus-textbook PRIVATE -ffp-contract=off)
target_compile_definitions(pelorus-textbook PRIVATE
  _XOPEN_SOURCE=700
  PELORUS_NAME="pelorus-textbook"
  PELORUS_ARCH=""
  PLR_REAL=64 PLR_PORTABLE=0
  PLR_MAX_LANDMARKS=${PELORUS_DESKTOP_LANDMARKS}
  PLR_MAX_OBSERVATIONS=${PELORUS_DESKTOP_OBSERVATIONS}
  PLR_BLOCK_OBSERVATIONS=${PLR_BLOCK_OBSERVATIONS})
pelorus_warnings(pelorus-textbook)
