// SPDX-License-Identifier: MIT
#ifndef PELORUS_CORTEX_M_STM32_USART_H
#define PELORUS_CORTEX_M_STM32_USART_H

#include <stdint.h>

/* Sets the USART at an address up for uart.h; its clock and pins are the board's matter. One USART
 * an image. */
void stm32_usart_start(uintptr_t address, uint32_t clock_hz, uint32_t baud);

#endif
