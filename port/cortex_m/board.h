// SPDX-License-Identifier: MIT
/*
 * What a board supplies besides its vector table and memory.ld. A new board is these functions, a
 * UART driver (uart.h) and, where there is one, a watchdog: docs/PORTING.md.
 */
#ifndef PELORUS_CORTEX_M_BOARD_H
#define PELORUS_CORTEX_M_BOARD_H

#include <stdbool.h>
#include <stdint.h>

#include "pelorus/port.h"

/* The name of its folder: it stands in the boot message. */
extern const char board_name[];

/* Sets up clocks, pins, the UART of the link and its interrupt. Every wait in it is bounded. */
void board_init(void);

/* The core's clock frequency after board_init. */
uint32_t board_core_hz(void);

/* Starts the hardware watchdog (about two seconds; longer than the longest erase of the storage, if
 * that stops the core), and tells it that the loop is alive. */
void board_watchdog_start(void);
void board_watchdog_feed(void);

/* Where the filter's state survives a power cut: fills in the device. False: there is no such
 * place. Its functions are bounded, and feed the watchdog if they take long. */
bool board_storage(plr_block_device *device);

/* Speed of the link: 8 data bits, no parity, 1 stop bit. */
enum { BOARD_BAUD = 921600 };

#endif
