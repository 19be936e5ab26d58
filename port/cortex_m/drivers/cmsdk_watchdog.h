// SPDX-License-Identifier: MIT
#ifndef PELORUS_CORTEX_M_CMSDK_WATCHDOG_H
#define PELORUS_CORTEX_M_CMSDK_WATCHDOG_H

#include <stdint.h>

/* Starts the watchdog at an address: without a feed for `ticks` of its clock it raises its
 * interrupt (NMI on MPS2), after as many again it resets the board. */
void cmsdk_watchdog_start(uintptr_t address, uint32_t ticks);
void cmsdk_watchdog_feed(uintptr_t address);

#endif
