// SPDX-License-Identifier: MIT
#ifndef PELORUS_CORTEX_M_CMSDK_UART_H
#define PELORUS_CORTEX_M_CMSDK_UART_H

#include "../uart.h"

/* Sets the UART at an address up for uart.h. */
void cmsdk_uart_start(uart *u, uintptr_t address, uint32_t clock_hz, uint32_t baud);

#endif
