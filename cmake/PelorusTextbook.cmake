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
