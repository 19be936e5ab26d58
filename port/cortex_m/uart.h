// SPDX-License-Identifier: MIT
/*
 * A UART's hardware, byte by byte: the only thing about a serial port that differs between chips.
 * serial.c makes a buffered port of it. Every function returns at once.
 */
#ifndef PELORUS_CORTEX_M_UART_H
#define PELORUS_CORTEX_M_UART_H

#include <stdbool.h>
#include <stdint.h>

/* One UART. The driver's own start function fills it, for board_init. */
typedef struct uart {
    uintptr_t base;    /* of its registers */
    uint32_t overruns; /* bytes that came faster than they were taken: the hardware lost them */
} uart;

/* Takes a received byte; false if none waits. */
bool uart_take(uart *u, uint8_t *byte);

/* Hands a byte to the transmitter; false if it is full. */
bool uart_give(uart *u, uint8_t byte);

/* Switch the interrupts "a byte has come" and "there is room for a byte". The second one is asked
 * for after uart_give, and withdrawn when nothing is left to send. */
void uart_receive_irq(uart *u, bool on);
void uart_transmit_irq(uart *u, bool on);

/* Takes back the interrupt requests that this hardware latches: first thing in the handler. */
void uart_acknowledge(uart *u);

#endif
