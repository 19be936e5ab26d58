// SPDX-License-Identifier: MIT
#ifndef PELORUS_CORTEX_M_STM32H7_USART_H
#define PELORUS_CORTEX_M_STM32H7_USART_H

#include "../uart.h"

/* Sets the USART at an address up for uart.h, with its FIFOs of 16 bytes; its clock and pins are the board's
 * matter. */
void stm32h7_usart_start(uart *u, uintptr_t address, uint32_t clock_hz, uint32_t baud);

/* The same for one that only sends, and by DMA: a block goes out while the next is filled. One of them. */
void stm32h7_usart_start_sender(uart *u, uintptr_t address, uint32_t clock_hz, uint32_t baud,
                                uint32_t request);

#endif
