# SPDX-License-Identifier: MIT
# The boards: processor, drivers, and the largest capacity whose image fits.

#   cpu_<name>: the flags that choose the processor and its FPU
set(cpu_m4f -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16)
set(cpu_m7 -mcpu=cortex-m7 -mthumb -mfloat-abi=hard -mfpu=fpv5-d16)
# Without the vector unit (Helium): it flushes subnormals to zero, the scalar FPU need not. Nor the
# scheduling before registers are chosen, with which gcc 12 loads so far ahead on this processor that
# the tiles of the kernels no longer fit into them: 8 % more instructions a frame.
set(cpu_m55 -mcpu=cortex-m55+nomve -mthumb -mfloat-abi=hard -mfpu=auto -fno-schedule-insns)

#   cpu_<name>_pixels: how src/vision/kernels.c is compiled beside that
set(cpu_m55_pixels -mcpu=cortex-m55+nomve.fp)

#   cpu_<name>_guard: how the stack's end is watched
set(cpu_m4f_guard stack_guard_mpu.c)
set(cpu_m7_guard stack_guard_mpu.c)
set(cpu_m55_guard stack_guard_limit.c)

#   board_<name>_cpu, _drivers, _largest (capacity N), _float64 (whether an image in double is made)
set(board_mps2_an386_cpu m4f)
set(board_mps2_an386_drivers mps2.c cmsdk_uart.c cmsdk_watchdog.c retained_ram.c)
set(board_mps2_an386_largest 64)

set(board_mps2_an500_cpu m7)
set(board_mps2_an500_drivers mps2.c cmsdk_uart.c cmsdk_watchdog.c retained_ram.c)
set(board_mps2_an500_largest 64)
set(board_mps2_an500_float64 TRUE)

set(board_mps3_an547_cpu m55)
set(board_mps3_an547_drivers cmsdk_uart.c cmsdk_watchdog.c retained_ram.c)
set(board_mps3_an547_largest 64)

set(board_stm32f405_cpu m4f)
set(board_stm32f405_drivers stm32_usart.c stm32_flash.c)
set(board_stm32f405_largest 48)

set(board_stm32h743_cpu m7)
set(board_stm32h743_drivers stm32h7_usart.c stm32h7_i2c.c stm32h7_camera.c stm32h7_imu.c mt9v034.c ../capture.c)
set(board_stm32h743_largest 32)

#   board_<name>_eyes: pixels of a picture, tracks, and landmarks of its images with eyes, if there are some; they take
#   memory_eyes.ld where the board has one
set(board_stm32f405_eyes 19200 32 32)
set(board_mps2_an500_eyes 76800 50 64)
set(board_mps3_an547_eyes 76800 50 64)
set(board_stm32h743_eyes 90240 50 64)

#   board_<name>_sensors: cameras and IMU of its images with eyes, in the place of pictures that come over the link
set(board_stm32h743_sensors sensors_stereo.c)

#   board_<name>_untried: it has run neither on hardware nor in an emulator; its files of a release say so
set(board_stm32h743_untried TRUE)
