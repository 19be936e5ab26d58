# SPDX-License-Identifier: MIT
# The library as Python loads it (tools/pelorus/native/binding.py), in each precision: pelorus-filter.so, .dll or .dylib
# beside pelorus-replay. With PELORUS_PYTHON, as pip builds it (pyproject.toml), these four are installed into
# the package.

# pelorus_python(NAME LIBRARY)
function(pelorus_python name library)
  set_property(TARGET ${library} PROPERTY POSITION_INDEPENDENT_CODE ON)
  if(CMAKE_C_COMPILER_ID STREQUAL "GNU") # else it inlines no function that another library could replace
    target_compile_options(${library} PRIVATE -fno-semantic-interposition)
  endif()
  add_library(${name} MODULE
    $<TARGET_OBJECTS:${library}>
    "${PROJECT_SOURCE_DIR}/port/python/binding.c" "${PROJECT_SOURCE_DIR}/port/posix/processor.c")
  set_target_properties(${name} PROPERTIES
    PREFIX "" LIBRARY_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/bin")
  target_include_directories(${name} PRIVATE
    "${PROJECT_SOURCE_DIR}/include" "${PROJECT_SOURCE_DIR}/port")
  target_compile_definitions(${name} PRIVATE
    $<TARGET_PROPERTY:${library},INTERFACE_COMPILE_DEFINITIONS>
    PELORUS_ARCH="$<$<NOT:$<BOOL:${PLR_PORTABLE}>>:${PELORUS_ARCH}>")
  if(APPLE)
    set_target_properties(${name} PROPERTIES SUFFIX ".dylib")
  endif()
  if(PLR_ASSERTIONS)
    target_link_libraries(${name} PRIVATE pelorus_assertion_failed)
    set_property(TARGET pelorus_assertion_failed PROPERTY POSITION_INDEPENDENT_CODE ON)
  endif()
  pelorus_warnings(${name})
endfunction()

pelorus_python(pelorus-filter pelorus_desktop)
pelorus_python(pelorus-filter-f64 pelorus_desktop_f64)

if(PELORUS_PYTHON)
  install(TARGETS pelorus-filter pelorus-filter-f64 LIBRARY DESTINATION pelorus/native COMPONENT python)
  install(TARGETS pelorus-replay pelorus-replay-f64 RUNTIME DESTINATION pelorus/native COMPONENT python)
endif()
