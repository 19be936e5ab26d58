# SPDX-License-Identifier: MIT
# The Unity test framework, as target pelorus_unity with asserts on double. No Debian package has
# it, so in this order:
#   1. an installed one (find_package), if it was built with asserts on double;
#   2. PELORUS_UNITY_DIR, a folder that holds src/unity.c;
#   3. the source package pytest-unity 0.1.0 from the Python package index, which carries Unity
#      2.7.0 (MIT), fetched by pip and held against the SHA256 below.
include(CheckCSourceCompiles)

set(PELORUS_UNITY_DIR "" CACHE PATH "A folder with src/unity.c; empty: look for it, else fetch it")
set(pelorus_unity_package pytest-unity==0.1.0)
set(pelorus_unity_archive pytest_unity-0.1.0.tar.gz)
set(pelorus_unity_sha256 cd3ceb4aeb4f7866f935957f91874999d8ae13ff014684464ade0b7071e28298)

function(pelorus_unity_from_system)
  find_package(unity CONFIG QUIET)
  if(NOT TARGET unity::framework)
    return()
  endif()
  set(CMAKE_REQUIRED_LIBRARIES unity::framework)
  set(CMAKE_REQUIRED_DEFINITIONS -DUNITY_INCLUDE_DOUBLE)
  check_c_source_compiles("#include <unity.h>
    void setUp(void) {} void tearDown(void) {}
    int main(void) { TEST_ASSERT_DOUBLE_WITHIN(0.1, 1.0, 1.0); return 0; }"
    PELORUS_SYSTEM_UNITY_HAS_DOUBLE)
  if(PELORUS_SYSTEM_UNITY_HAS_DOUBLE)
    add_library(pelorus_unity INTERFACE)
    target_link_libraries(pelorus_unity INTERFACE unity::framework)
    target_compile_definitions(pelorus_unity INTERFACE UNITY_INCLUDE_DOUBLE)
    message(STATUS "Unity: the installed one")
  endif()
endfunction()

# Asks pip for the archive. pip's own check of the hash is repeated by the caller, who may have found
# the archive from an earlier run.
function(pelorus_unity_download archive)
  find_package(Python3 COMPONENTS Interpreter REQUIRED)
  file(WRITE "${PELORUS_DEPS_DIR}/unity-requirement.txt"
    "${pelorus_unity_package} --hash=sha256:${pelorus_unity_sha256}\n")
  message(STATUS "Unity: fetching ${pelorus_unity_package} with pip")
  execute_process(
    COMMAND "${Python3_EXECUTABLE}" -m pip download --quiet --no-deps --no-binary pytest-unity
            --requirement "${PELORUS_DEPS_DIR}/unity-requirement.txt" --dest "${PELORUS_DEPS_DIR}"
    RESULT_VARIABLE status ERROR_VARIABLE errors OUTPUT_VARIABLE errors)
  if(NOT status EQUAL 0 OR NOT EXISTS "${archive}")
    message(FATAL_ERROR "The test framework Unity could not be fetched:\n${errors}\n"
      "Give PELORUS_UNITY_DIR=<a folder with src/unity.c>, "
      "or Python3_EXECUTABLE=<a Python that has pip>, or PELORUS_BUILD_TESTS=OFF.")
  endif()
endfunction()

function(pelorus_unity_from_archive result)
  set(archive "${PELORUS_DEPS_DIR}/${pelorus_unity_archive}")
  if(NOT EXISTS "${archive}")
    pelorus_unity_download("${archive}")
  endif()
  file(SHA256 "${archive}" found)
  if(NOT found STREQUAL pelorus_unity_sha256)
    message(FATAL_ERROR "${archive} has SHA256 ${found}, not ${pelorus_unity_sha256}. "
      "Remove it and configure again.")
  endif()
  file(ARCHIVE_EXTRACT INPUT "${archive}" DESTINATION "${PELORUS_DEPS_DIR}"
    PATTERNS "*/vendor/unity/src/*" "*/vendor/unity/LICENSE.txt")
  set(${result} "${PELORUS_DEPS_DIR}/pytest_unity-0.1.0/vendor/unity" PARENT_SCOPE)
endfunction()

if(NOT PELORUS_UNITY_DIR)
  pelorus_unity_from_system()
endif()
if(NOT TARGET pelorus_unity)
  set(pelorus_unity_dir "${PELORUS_UNITY_DIR}")
  if(NOT pelorus_unity_dir)
    pelorus_unity_from_archive(pelorus_unity_dir)
  endif()
  if(NOT EXISTS "${pelorus_unity_dir}/src/unity.c")
    message(FATAL_ERROR "${pelorus_unity_dir} holds no src/unity.c.")
  endif()
  add_library(pelorus_unity STATIC "${pelorus_unity_dir}/src/unity.c")
  target_include_directories(pelorus_unity SYSTEM PUBLIC "${pelorus_unity_dir}/src")
  target_compile_definitions(pelorus_unity PUBLIC UNITY_INCLUDE_DOUBLE UNITY_SUPPORT_64)
  message(STATUS "Unity: ${pelorus_unity_dir}")
endif()
