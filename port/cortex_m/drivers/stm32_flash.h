// SPDX-License-Identifier: MIT
/*
 * A block device in the flash of the STM32F4 families (RM0090, chapter 3): its last two sectors of
 * 128 KB, 10 and 11 of a part with 1 MB, which memory.ld's region STORAGE keeps free of code.
 *
 * While a sector is erased the bus to the flash stands still, and with it the core, its interrupts
 * and the clock: 1 s as a rule, 2 s at most with x32 (data sheet DS8626, flash memory programming).
 * What arrives meanwhile is lost, so a state is saved when the robot is parked; and the watchdog's
 * shortest period must be longer than that. Programming with x32 asks for a supply of 2.7 V.
 */
#ifndef PELORUS_CORTEX_M_STM32_FLASH_H
#define PELORUS_CORTEX_M_STM32_FLASH_H

#include "pelorus/port.h"

plr_block_device stm32_flash(void);

#endif
