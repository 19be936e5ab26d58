// SPDX-License-Identifier: MIT
/* The UART of Arm's Cortex-M System Design Kit, as in the MPS2 and MPS3 FPGA images. Registers:
 * CMSDK Technical Reference Manual (DDI 0479), section 4.3. */
#include "cmsdk_uart.h"

enum {
    DATA = 0x00,
    STATE = 0x04,
    CTRL = 0x08,
    INTCLEAR = 0x0C,
    BAUDDIV = 0x10,

    STATE_TX_FULL = 1 << 0,
    STATE_RX_FULL = 1 << 1,
    STATE_RX_OVERRUN = 1 << 3, /* a one written clears it */

    CTRL_TX_ENABLE = 1 << 0,
    CTRL_RX_ENABLE = 1 << 1,
    CTRL_TX_IRQ = 1 << 2,
    CTRL_RX_IRQ = 1 << 3,

    INT_TX = 1 << 0,
    INT_RX = 1 << 1,

    BAUDDIV_LEAST = 16 /* the hardware ignores less */
};

static volatile uint32_t *at(const uart *u, unsigned offset) {
    return (volatile uint32_t *)(u->base + offset);
}

void cmsdk_uart_start(uart *u, uintptr_t address, uint32_t clock_hz, uint32_t baud) {
    u->base = address;
    u->overruns = 0;
    const uint32_t divider = (clock_hz + baud / 2) / baud;
    *at(u, BAUDDIV) = divider < BAUDDIV_LEAST ? BAUDDIV_LEAST : divider;
    *at(u, CTRL) = CTRL_TX_ENABLE | CTRL_RX_ENABLE;
    *at(u, INTCLEAR) = INT_TX | INT_RX;
}

bool uart_take(uart *u, uint8_t *byte) {
    const uint32_t state = *at(u, STATE);
    if ((state & STATE_RX_OVERRUN) != 0) {
        ++u->overruns;
        *at(u, STATE) = STATE_RX_OVERRUN;
    }
    if ((state & STATE_RX_FULL) == 0) {
        return false;
    }
    *byte = (uint8_t)*at(u, DATA);
    return true;
}

bool uart_give(uart *u, uint8_t byte) {
    if ((*at(u, STATE) & STATE_TX_FULL) != 0) {
        return false;
    }
    *at(u, DATA) = byte;
    return true;
}

static void switch_irq(uart *u, uint32_t bit, bool on) {
    *at(u, CTRL) = on ? *at(u, CTRL) | bit : *at(u, CTRL) & ~bit;
}

void uart_receive_irq(uart *u, bool on) {
    switch_irq(u, CTRL_RX_IRQ, on);
}

void uart_transmit_irq(uart *u, bool on) {
    switch_irq(u, CTRL_TX_IRQ, on);
}

void uart_acknowledge(uart *u) {
    *at(u, INTCLEAR) = INT_TX | INT_RX;
}
