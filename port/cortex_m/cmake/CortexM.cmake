# SPDX-License-Identifier: MIT
# How an image is made of the library, the port and a board.

include("${PELORUS_ROOT}/src/sources.cmake")
pelorus_sources(PELORUS_SOURCES)

# Where the instructions of frames and readings are spent: -O3, with which they take two thirds of -O2's. The
# rest of the library is compiled to be small, -Os, and so is what few frames need of these (PLR_SELDOM): 57 KB less,
# for 2 % more instructions a frame and 4 % more a reading at N = 32. No level changes a bit.
set(spent_in ${PELORUS_SOURCES})
list(FILTER spent_in INCLUDE REGEX "/src/(math/(blocks3|checksum|dense|packed|se3|so3)|process/(imu[a-z_]*|twist|statistics)|sensor/stereo|\
state/(covariance[a-z_]*|model_body|polar|rigid_fit)|\
filter/(correction|guard|motion_first|search)|\
vision/(corners|kernels|lens|patch|pyramid|rig|track|vision|watch))\\.c$")
set_source_files_properties(${spent_in} PROPERTIES COMPILE_OPTIONS -O3)

# The loops over pixels may be in vectors of integers: they change no bit, which those of floats would.
set_source_files_properties("${PELORUS_ROOT}/src/vision/kernels.c" PROPERTIES
  COMPILE_OPTIONS "-O3;$<TARGET_PROPERTY:PIXEL_OPTIONS>")

set(PORT "${CMAKE_CURRENT_SOURCE_DIR}")
set(IMAGES "${CMAKE_CURRENT_BINARY_DIR}/images")
file(MAKE_DIRECTORY "${IMAGES}")

# What every image needs: reset to main, link, clock, fault reports. It knows nothing of the library's sizes;
# panic.c, which writes a message, does.
set(PORT_SOURCES startup.c serial.c clock.c fault.c text.c)
list(TRANSFORM PORT_SOURCES PREPEND "${PORT}/")

set(telemetry_sources "${PORT}/telemetry_none.c")
if(PELORUS_MAVLINK)
  set(telemetry_sources "${PORT}/telemetry_mavlink.c" "${PELORUS_ROOT}/port/mavlink/odometry.c"
    "${mavlink_encoder}")
endif()

# No function of these may be linked: the library and the firmware have neither heap nor stdio, and
# newlib's fma is not fused. --wrap turns every reference into one that nobody defines.
set(FORBIDDEN malloc calloc realloc free _malloc_r _free_r _sbrk printf snprintf vsnprintf fprintf
  puts fopen fma fmaf sin cos tan atan2 exp log pow sinf cosf tanf atan2f expf logf powf)
list(TRANSFORM FORBIDDEN PREPEND "-Wl,--wrap=")

# By the bits of a number, which fill most of a frame. tests/target holds it against what the deepest
# chain of calls takes.
set(stack_bytes_32 8192)
set(stack_bytes_64 16384)

# -fstack-usage and -fcallgraph-info are what docs/SIZES.md's bound of the stack is made from.
set(flags_c -O2 -ffp-contract=off -fno-math-errno -fsigned-char
  -ffunction-sections -fdata-sections -fno-common -fstack-usage -fcallgraph-info=su
  -Wall -Wextra -pedantic -Wconversion -Wdouble-promotion -Wvla -Wshadow -Wmissing-prototypes
  $<$<BOOL:${PELORUS_WERROR}>:-Werror>)

function(cortexm_options target cpu)
  set_target_properties(${target} PROPERTIES
    C_STANDARD 99 C_STANDARD_REQUIRED ON C_EXTENSIONS OFF EXCLUDE_FROM_ALL ON)
  target_compile_options(${target} PRIVATE ${cpu_${cpu}} -g)
  set_target_properties(${target} PROPERTIES PIXEL_OPTIONS "${cpu_${cpu}_pixels}")
  target_compile_options(${target} PRIVATE "$<$<COMPILE_LANGUAGE:C>:${flags_c}>")
endfunction()

# The boards asked for, all folders of boards/ if none is. Stops where one cannot be built, saying why.
function(cortexm_boards result asked)
  file(GLOB there CONFIGURE_DEPENDS RELATIVE "${PORT}/boards" "${PORT}/boards/*/memory.ld")
  list(TRANSFORM there REPLACE "/memory.ld$" "")
  if(NOT asked)
    set(asked ${there})
  endif()
  foreach(board IN LISTS asked)
    if(NOT board IN_LIST there)
      message(FATAL_ERROR "There is no boards/${board}/memory.ld; boards are: ${there}")
    endif()
    foreach(what IN ITEMS cpu drivers largest)
      if(NOT DEFINED board_${board}_${what})
        message(FATAL_ERROR "cmake/Boards.cmake does not set board_${board}_${what}")
      endif()
    endforeach()
    if(NOT DEFINED cpu_${board_${board}_cpu})
      message(FATAL_ERROR "cmake/Boards.cmake: board_${board}_cpu is ${board_${board}_cpu}, and no "
        "cpu_${board_${board}_cpu} holds its flags")
    endif()
  endforeach()
  set(${result} ${asked} PARENT_SCOPE)
endfunction()

# The library for a processor, a capacity and a precision; boards of the same processor share it.
function(cortexm_library result cpu capacity bits)
  set(name pelorus-${cpu}-n${capacity}-f${bits})
  if(NOT TARGET ${name})
    add_library(${name} STATIC ${PELORUS_SOURCES})
    cortexm_options(${name} ${cpu})
    target_compile_options(${name} PRIVATE -Os)
    target_include_directories(${name}
      PUBLIC "${PELORUS_ROOT}/include" PRIVATE "${PELORUS_ROOT}/src")
    # Few landmarks come with few observations: they may make up four times as many, 64 at least.
    math(EXPR observations "4 * ${capacity}")
    if(observations LESS 64)
      set(observations 64)
    elseif(observations GREATER PLR_MAX_OBSERVATIONS)
      set(observations ${PLR_MAX_OBSERVATIONS})
    endif()
    # A tile of 4 x 6 fills the FPU's 32 registers; the width changes no bit.
    target_compile_definitions(${name} PUBLIC PLR_REAL=${bits} PLR_MAX_LANDMARKS=${capacity}
      PLR_MAX_OBSERVATIONS=${observations} PLR_BLOCK_OBSERVATIONS=8 PLR_PORTABLE=0
      PLR_TILE_COLUMNS=6)
    if(DEFINED PLR_MAX_CALIBRATION)
      target_compile_definitions(${name} PUBLIC PLR_MAX_CALIBRATION=${PLR_MAX_CALIBRATION})
    endif()
    foreach(option PLR_SUPERVISE PLR_KNOWN_MAP PLR_VISION)
      if(DEFINED ${option})
        target_compile_definitions(${name} PUBLIC ${option}=$<BOOL:${${option}}>)
      endif()
    endforeach()
  endif()
  set(${result} ${name} PARENT_SCOPE)
endfunction()

# What all images of a board share, compiled once.
function(cortexm_port board)
  set(name port-${board})
  if(NOT TARGET ${name})
    set(cpu ${board_${board}_cpu})
    set(drivers ${board_${board}_drivers} ${cpu_${cpu}_guard})
    list(TRANSFORM drivers PREPEND "${PORT}/drivers/")
    add_library(${name} OBJECT ${PORT_SOURCES} ${drivers} "${PORT}/boards/${board}/board.c")
    cortexm_options(${name} ${cpu})
    target_include_directories(${name} PRIVATE "${PELORUS_ROOT}/include")
  endif()
endfunction()

# The library with room for a board's pictures. Tracks are all that a frame shows.
function(cortexm_eyes_library result board)
  set(name pelorus-eyes-${board})
  list(GET board_${board}_eyes 0 pixels)
  list(GET board_${board}_eyes 1 tracks)
  list(GET board_${board}_eyes 2 landmarks)
  if(NOT TARGET ${name})
    add_library(${name} STATIC ${PELORUS_SOURCES})
    cortexm_options(${name} ${board_${board}_cpu})
    target_compile_options(${name} PRIVATE -Os)
    target_include_directories(${name} PUBLIC "${PELORUS_ROOT}/include" PRIVATE "${PELORUS_ROOT}/src")
    target_compile_definitions(${name} PUBLIC PLR_REAL=32 PLR_MAX_LANDMARKS=${landmarks}
      PLR_MAX_OBSERVATIONS=${tracks} PLR_BLOCK_OBSERVATIONS=8 PLR_PORTABLE=0 PLR_TILE_COLUMNS=6
      PLR_VISION=1 PLR_VISION_PIXELS=${pixels} PLR_VISION_TRACKS=${tracks})
  endif()
  set(${result} ${name} PARENT_SCOPE)
endfunction()

# An image `name` for a board, out of sources and a library of that precision, in all three forms.
function(cortexm_image name board library bits)
  set(cpu ${board_${board}_cpu})
  set(folder "${PORT}/boards/${board}")
  set(script memory.ld)
  if(name MATCHES "eyes" AND EXISTS "${folder}/memory_eyes.ld")
    set(script memory_eyes.ld)
  endif()
  cortexm_port(${board})
  add_executable(${name} ${ARGN} "${PORT}/panic.c" $<TARGET_OBJECTS:port-${board}>)
  cortexm_options(${name} ${cpu})
  set_target_properties(${name} PROPERTIES
    SUFFIX .elf RUNTIME_OUTPUT_DIRECTORY "${IMAGES}"
    LINK_DEPENDS "${folder}/${script};${PORT}/boards/sections.ld")
  target_link_libraries(${name} PRIVATE ${library})
  target_link_options(${name} PRIVATE ${cpu_${cpu}} -nostartfiles --specs=nano.specs
    "-Wl,--defsym=STACK_SIZE=${stack_bytes_${bits}}"
    -T "${folder}/${script}" "-L${PORT}/boards" "-L${folder}" -Wl,--gc-sections -Wl,--fatal-warnings
    "-Wl,-Map=${IMAGES}/${name}.map" ${FORBIDDEN})
  add_custom_command(TARGET ${name} POST_BUILD
    COMMAND "${CMAKE_OBJCOPY}" -O binary "${IMAGES}/${name}.elf" "${IMAGES}/${name}.bin"
    COMMAND "${CMAKE_OBJCOPY}" -O ihex "${IMAGES}/${name}.elf" "${IMAGES}/${name}.hex")
endfunction()

# eyes-<board>, the firmware with eyes, and eyes-replay-<board>, which carries a recording with pictures and is linked for
# QEMU: PELORUS_CCM_ORIGIN says where that has a second memory.
function(cortexm_eyes board)
  cortexm_eyes_library(library ${board})
  set(sensors eyes_static.c sensors_none.c)
  if(DEFINED board_${board}_sensors)
    set(sensors ${board_${board}_sensors})
  endif()
  list(TRANSFORM sensors PREPEND "${PORT}/")
  cortexm_image(eyes-${board} ${board} ${library} 32
    "${PORT}/main_firmware.c" "${PORT}/port_serial.c" ${sensors} "${PORT}/telemetry_none.c")
  add_dependencies(eyes eyes-${board})
  set(recording "${PELORUS_EYES_RECORDINGS}/${board}.plr")
  if(NOT PELORUS_EYES_RECORDINGS OR NOT EXISTS "${recording}")
    return()
  endif()
  cortexm_image(eyes-replay-${board} ${board} ${library} 32
    "${PORT}/main_eyes.c" "${PORT}/eyes_static.c" "${PORT}/bench_recording.S")
  target_compile_definitions(eyes-replay-${board} PRIVATE "BENCH_RECORDING=\"${recording}\"")
  set_property(SOURCE "${PORT}/bench_recording.S" APPEND PROPERTY OBJECT_DEPENDS "${recording}")
  if(PELORUS_CCM_ORIGIN)
    target_link_options(eyes-replay-${board} PRIVATE "-Wl,--defsym=CCM_ORIGIN=${PELORUS_CCM_ORIGIN}")
  endif()
  add_dependencies(eyes eyes-replay-${board})
endfunction()

function(cortexm_bringup board)
  cortexm_library(library ${board_${board}_cpu} 32 32)
  cortexm_image(bringup-${board} ${board} ${library} 32 "${PORT}/main_bringup.c")
  add_dependencies(bringup bringup-${board})
endfunction()

# The kernels against their plain twins: tests/target/test_kernels.py runs it. Without tests/, as
# where somebody has taken the library and this port alone, there is no such image.
function(cortexm_kernels board)
  set(source "${PELORUS_ROOT}/tests/target/main_kernels.c")
  if(NOT EXISTS "${source}")
    return()
  endif()
  cortexm_library(library ${board_${board}_cpu} 32 32)
  cortexm_image(kernels-${board} ${board} ${library} 32 "${source}")
  target_include_directories(kernels-${board} PRIVATE "${PORT}" "${PELORUS_ROOT}/src")
  add_dependencies(bringup kernels-${board})
endfunction()

function(cortexm_firmware board capacity bits)
  cortexm_library(library ${board_${board}_cpu} ${capacity} ${bits})
  set(suffix ${board}-n${capacity})
  if(bits EQUAL 64)
    string(APPEND suffix -f64)
  endif()
  cortexm_image(pelorus-${suffix} ${board} ${library} ${bits}
    "${PORT}/main_firmware.c" "${PORT}/port_serial.c" "${PORT}/eyes_none.c" "${PORT}/sensors_none.c"
    ${telemetry_sources})
  if(PELORUS_MAVLINK)
    add_dependencies(pelorus-${suffix} pelorus_mavlink_headers)
  endif()
  add_dependencies(boards pelorus-${suffix})
endfunction()

# What the filter costs, with a recording inside: one image a recording, for the flash does not hold all.
function(cortexm_bench board capacity recording)
  cortexm_library(library ${board_${board}_cpu} ${capacity} 32)
  get_filename_component(stem "${recording}" NAME_WE)
  set(name bench-${stem}-${board}-n${capacity})
  cortexm_image(${name} ${board} ${library} 32 "${PORT}/main_bench.c" "${PORT}/bench_recording.S")
  set_source_files_properties("${PORT}/bench_recording.S" PROPERTIES
    OBJECT_DEPENDS "${PELORUS_BENCH_RECORDINGS}")
  target_compile_definitions(${name} PRIVATE "BENCH_RECORDING=\"${recording}\""
    BENCH_CALIBRATE=${PELORUS_BENCH_CALIBRATE})
  add_dependencies(bench ${name})
endfunction()
