// SPDX-License-Identifier: MIT
/* A clock that never wraps, from the core's 24-bit SysTick. */
#ifndef PELORUS_CORTEX_M_CLOCK_H
#define PELORUS_CORTEX_M_CLOCK_H

#include <stdint.h>

/* Starts at zero, with an interrupt every millisecond: it also ends a sleep. */
void clock_start(uint32_t core_hz);

/* Nanoseconds since clock_start; resolution: one core clock. Ascends. */
uint64_t clock_ns(void);

/* Comes back after so many milliseconds. */
void clock_wait_ms(uint32_t ms);

#endif
