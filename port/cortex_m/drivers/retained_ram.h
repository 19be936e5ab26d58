// SPDX-License-Identifier: MIT
/*
 * A block device in RAM that no reset clears: memory.ld's region RETAINED, which the startup leaves
 * alone and no section lies in. On a board it would be RAM with a battery, or FRAM; where it is plain
 * RAM, as under an emulator, a state survives the reset button, a fault and the watchdog, but not the
 * power's end.
 */
#ifndef PELORUS_CORTEX_M_RETAINED_RAM_H
#define PELORUS_CORTEX_M_RETAINED_RAM_H

#include "pelorus/port.h"

/* The device over the whole region. What it holds after power-on is anything: the store checks. */
plr_block_device retained_ram(void);

#endif
