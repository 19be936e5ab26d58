// SPDX-License-Identifier: MIT
/* The USART of the STM32F2 and F4 families. Registers: RM0090, section 30.6. */
#include "stm32_usart.h"

enum {
    SR = 0x00,
    DR = 0x04,
    BRR = 0x08,
    CR1 = 0x0C,

    SR_ORE = 1 << 3, /* overrun: cleared by reading SR, then DR */
    SR_RXNE = 1 << 5,
    SR_TXE = 1 << 7,

    CR1_RE = 1 << 2,
    CR1_TE = 1 << 3,
    CR1_RXNEIE = 1 << 5,
    CR1_TXEIE = 1 << 7,
    CR1_UE = 1 << 13
};

static volatile uint32_t *at(const uart *u, unsigned offset) {
    return (volatile uint32_t *)(u->base + offset);
}

void stm32_usart_start(uart *u, uintptr_t address, uint32_t clock_hz, uint32_t baud) {
    u->base = address;
    u->overruns = 0;
    *at(u, CR1) = 0;
    *at(u, BRR) = (clock_hz + baud / 2) / baud; /* 12 bits of mantissa and 4 of fraction in one */
    *at(u, CR1) = CR1_UE | CR1_TE | CR1_RE;
}

bool uart_take(uart *u, uint8_t *byte) {
    const uint32_t status = *at(u, SR);
    if ((status & (SR_RXNE | SR_ORE)) == 0) {
        return false;
    }
    if ((status & SR_ORE) != 0) {
        ++u->overruns;
    }
    *byte = (uint8_t)*at(u, DR);
    return (status & SR_RXNE) != 0;
}

bool uart_give(uart *u, uint8_t byte) {
    if ((*at(u, SR) & SR_TXE) == 0) {
        return false;
    }
    *at(u, DR) = byte;
    return true;
}

static void switch_irq(uart *u, uint32_t bit, bool on) {
    *at(u, CR1) = on ? *at(u, CR1) | bit : *at(u, CR1) & ~bit;
}

void uart_receive_irq(uart *u, bool on) {
    switch_irq(u, CR1_RXNEIE, on);
}

void uart_transmit_irq(uart *u, bool on) {
    switch_irq(u, CR1_TXEIE, on);
}

void uart_acknowledge(uart *u) {
    (void)u; /* both requests go with their cause: reading or writing DR. */
}
