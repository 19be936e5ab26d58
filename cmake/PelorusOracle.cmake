# SPDX-License-Identifier: MIT
# OpenBLAS and LAPACKE, as target pelorus_blas: the tests' oracle and the bench's opponent. The
# library itself never links them.
find_path(PELORUS_CBLAS_INCLUDE cblas.h
  PATHS "/usr/include/${CMAKE_LIBRARY_ARCHITECTURE}" PATH_SUFFIXES openblas)
find_path(PELORUS_LAPACKE_INCLUDE lapacke.h PATH_SUFFIXES openblas lapacke)
find_library(PELORUS_OPENBLAS_LIBRARY openblas)
find_library(PELORUS_LAPACKE_LIBRARY lapacke)

if(PELORUS_CBLAS_INCLUDE AND PELORUS_LAPACKE_INCLUDE
    AND PELORUS_OPENBLAS_LIBRARY AND PELORUS_LAPACKE_LIBRARY)
  add_library(pelorus_blas INTERFACE)
  target_include_directories(pelorus_blas SYSTEM INTERFACE
    "${PELORUS_CBLAS_INCLUDE}" "${PELORUS_LAPACKE_INCLUDE}")
  target_link_libraries(pelorus_blas INTERFACE
    "${PELORUS_LAPACKE_LIBRARY}" "${PELORUS_OPENBLAS_LIBRARY}")
elseif(PELORUS_REQUIRE_ORACLE)
  message(FATAL_ERROR "OpenBLAS or LAPACKE is missing: "
    "apt-get install libopenblas-dev liblapacke-dev, or PELORUS_REQUIRE_ORACLE=OFF.")
elseif(PELORUS_BUILD_TESTS)
  message(WARNING "OpenBLAS or LAPACKE is missing: the tests are held against plain loops instead, "
    "and the bench and pelorus-textbook are left out. "
    "apt-get install libopenblas-dev liblapacke-dev.")
else()
  message(STATUS "OpenBLAS or LAPACKE is missing: pelorus-textbook is left out "
    "(apt-get install libopenblas-dev liblapacke-dev)")
endif()
