# SPDX-License-Identifier: MIT
# Pelorus as a component of ESP-IDF. Its sizes are set in the project's CMakeLists.txt, before project():
#
#   set(PLR_MAX_LANDMARKS 16)
#   set(PLR_MAX_OBSERVATIONS 64)
include("${CMAKE_CURRENT_LIST_DIR}/../../src/sources.cmake")
pelorus_sources(pelorus_component_sources)
get_filename_component(pelorus_component_root "${CMAKE_CURRENT_LIST_DIR}/../.." ABSOLUTE)
idf_component_register(
  SRCS ${pelorus_component_sources}
  INCLUDE_DIRS "${pelorus_component_root}/include"
  PRIV_INCLUDE_DIRS "${pelorus_component_root}/src")
target_compile_options(${COMPONENT_LIB} PRIVATE -ffp-contract=off -fno-math-errno)
foreach(option PLR_MAX_LANDMARKS PLR_MAX_OBSERVATIONS PLR_MAX_CALIBRATION PLR_PORTABLE PLR_SUPERVISE PLR_KNOWN_MAP
    PLR_VISION PLR_VISION_PIXELS PLR_VISION_TRACKS PLR_VISION_LEVELS)
  if(DEFINED ${option})
    target_compile_definitions(${COMPONENT_LIB} PUBLIC ${option}=${${option}})
  endif()
endforeach()
