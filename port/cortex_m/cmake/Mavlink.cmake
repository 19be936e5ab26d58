# SPDX-License-Identifier: MIT
# MAVLink's C headers, generated from the message definitions that pymavlink carries, as the target
# pelorus_mavlink. They are foreign code in GNU C: system headers, which are not warned about.
if(NOT PELORUS_MAVLINK)
  return()
endif()
find_package(Python3 COMPONENTS Interpreter REQUIRED)
execute_process(
  COMMAND "${Python3_EXECUTABLE}" -c
    "import pathlib, pymavlink; print(pathlib.Path(pymavlink.__file__).parent / 'dialects/v20')"
  OUTPUT_VARIABLE definitions OUTPUT_STRIP_TRAILING_WHITESPACE RESULT_VARIABLE status)
if(NOT status EQUAL 0 OR NOT EXISTS "${definitions}/common.xml")
  message(FATAL_ERROR "${Python3_EXECUTABLE} has no pymavlink with its message definitions. "
    "Install it, or give Python3_EXECUTABLE=<one that has it>, or PELORUS_MAVLINK=OFF.")
endif()

set(mavlink_headers "${CMAKE_CURRENT_BINARY_DIR}/mavlink")
add_custom_command(OUTPUT "${mavlink_headers}/common/mavlink.h"
  COMMAND "${Python3_EXECUTABLE}" -m pymavlink.tools.mavgen --lang=C --wire-protocol=2.0
    -o "${mavlink_headers}" "${definitions}/common.xml"
  DEPENDS "${definitions}/common.xml"
  COMMENT "Generating MAVLink headers")
add_custom_target(pelorus_mavlink_headers DEPENDS "${mavlink_headers}/common/mavlink.h")

# For each image: MAVLink keeps static state, and GNU C is needed for its packed structs.
set(mavlink_encoder "${PELORUS_ROOT}/port/mavlink/encode.c")
set_source_files_properties("${mavlink_encoder}" PROPERTIES
  COMPILE_OPTIONS "-std=gnu99;-isystem;${mavlink_headers};-Wno-address-of-packed-member")
