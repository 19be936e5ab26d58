// SPDX-License-Identifier: MIT
/*
 * What a board supplies besides its vector table and memory.ld. A new board is these functions, a
 * UART driver (uart.h) and, where there is one, a watchdog: docs/PORTING.md.
 */
#ifndef PELORUS_CORTEX_M_BOARD_H
#define PELORUS_CORTEX_M_BOARD_H

#include <stdint.h>

/* The name of its folder: it stands in the boot message. */
extern const char board_name[];

/* Sets up clocks, pins, the UART of the link and its interrupt. Every wait in it is bounded. */
void board_init(void);

/* What the core runs at, after board_init. */
uint32_t board_core_hz(void);

/* Starts the hardware watchdog (about two seconds), and tells it that the loop is alive. */
void board_watchdog_start(void);
void board_watchdog_feed(void);

/* How the link runs: 8 data bits, no parity, 1 stop bit. */
enum { BOARD_BAUD = 921600 };

#endif
