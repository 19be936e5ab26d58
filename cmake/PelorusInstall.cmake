# SPDX-License-Identifier: MIT
# Install rules: find_package(pelorus) then gives pelorus::pelorus and pelorus::pelorus_f64.
if(NOT PELORUS_INSTALL)
  return()
endif()
include(CMakePackageConfigHelpers)

set(pelorus_package_dir "${CMAKE_INSTALL_LIBDIR}/cmake/pelorus")
install(TARGETS pelorus pelorus_f64 EXPORT pelorusTargets
  ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}")
install(DIRECTORY "${PROJECT_SOURCE_DIR}/include/pelorus"
  DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}" FILES_MATCHING PATTERN "*.h" PATTERN "*.def")
install(EXPORT pelorusTargets NAMESPACE pelorus:: DESTINATION "${pelorus_package_dir}")
configure_package_config_file(
  "${PROJECT_SOURCE_DIR}/cmake/pelorusConfig.cmake.in"
  "${PROJECT_BINARY_DIR}/pelorusConfig.cmake"
  INSTALL_DESTINATION "${pelorus_package_dir}")
write_basic_package_version_file("${PROJECT_BINARY_DIR}/pelorusConfigVersion.cmake"
  COMPATIBILITY SameMajorVersion)
install(FILES
  "${PROJECT_BINARY_DIR}/pelorusConfig.cmake" "${PROJECT_BINARY_DIR}/pelorusConfigVersion.cmake"
  DESTINATION "${pelorus_package_dir}")

# pkg-config --cflags --libs pelorus (or pelorus_f64): the definitions are those that the library has.
foreach(PELORUS_PC_NAME pelorus pelorus_f64)
  get_target_property(definitions ${PELORUS_PC_NAME} INTERFACE_COMPILE_DEFINITIONS)
  list(TRANSFORM definitions PREPEND "-D")
  list(JOIN definitions " " PELORUS_PC_DEFINITIONS)
  configure_file("${PROJECT_SOURCE_DIR}/cmake/pelorus.pc.in"
    "${PROJECT_BINARY_DIR}/${PELORUS_PC_NAME}.pc.generated" @ONLY)
  file(GENERATE OUTPUT "${PROJECT_BINARY_DIR}/${PELORUS_PC_NAME}.pc"
    INPUT "${PROJECT_BINARY_DIR}/${PELORUS_PC_NAME}.pc.generated")
  install(FILES "${PROJECT_BINARY_DIR}/${PELORUS_PC_NAME}.pc"
    DESTINATION "${CMAKE_INSTALL_LIBDIR}/pkgconfig")
endforeach()
if(TARGET pelorus-replay)
  install(TARGETS pelorus-replay pelorus-replay-f64 RUNTIME DESTINATION "${CMAKE_INSTALL_BINDIR}")
endif()
