// SPDX-License-Identifier: MIT
#ifndef PELORUS_CORTEX_M_STM32_USART_H
#define PELORUS_CORTEX_M_STM32_USART_H

#include "../uart.h"

/* Sets the USART at an address up for uart.h; its clock and pins are the board's matter. */
void stm32_usart_start(uart *u, uintptr_t address, uint32_t clock_hz, uint32_t baud);

#endif
