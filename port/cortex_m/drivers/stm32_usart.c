// SPDX-License-Identifier: MIT
/* The USART of the STM32F2 and F4 families. Registers: RM0090, section 30.6. */
#include "stm32_usart.h"

#include "../core.h"
#include "../uart.h"

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

static uintptr_t base;
static uint32_t overruns;

static volatile uint32_t *at(unsigned offset) {
    return (volatile uint32_t *)(base + offset);
}

void stm32_usart_start(uintptr_t address, uint32_t clock_hz, uint32_t baud) {
    base = address;
    *at(CR1) = 0;
    *at(BRR) = (clock_hz + baud / 2) / baud; /* oversampling by 16: mantissa and fraction in one */
    *at(CR1) = CR1_UE | CR1_TE | CR1_RE;
}

bool uart_take(uint8_t *byte) {
    const uint32_t status = *at(SR);
    if ((status & (SR_RXNE | SR_ORE)) == 0) {
        return false;
    }
    if ((status & SR_ORE) != 0) {
        ++overruns;
    }
    *byte = (uint8_t)*at(DR);
    return (status & SR_RXNE) != 0;
}

bool uart_give(uint8_t byte) {
    if ((*at(SR) & SR_TXE) == 0) {
        return false;
    }
    *at(DR) = byte;
    return true;
}

static void switch_irq(uint32_t bit, bool on) {
    *at(CR1) = on ? *at(CR1) | bit : *at(CR1) & ~bit;
}

void uart_receive_irq(bool on) {
    switch_irq(CR1_RXNEIE, on);
}

void uart_transmit_irq(bool on) {
    switch_irq(CR1_TXEIE, on);
}

void uart_acknowledge(void) {
    /* Both requests go with their cause: reading or writing DR. */
}

uint32_t uart_overruns(void) {
    return overruns;
}
