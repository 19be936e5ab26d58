// SPDX-License-Identifier: MIT
/* The USART of the STM32H7 family: RM0433, section 48.8. */
#include "stm32h7_usart.h"

#include "stm32h7.h"

enum {
    CR1 = 0x00,
    CR3 = 0x08,
    BRR = 0x0C,
    ISR = 0x1C,
    ICR = 0x20,
    RDR = 0x24,
    TDR = 0x28,

    CR1_UE = 1 << 0,
    CR1_RE = 1 << 2,
    CR1_TE = 1 << 3,
    CR1_RXFNEIE = 1 << 5,
    CR1_FIFOEN = 1 << 29,
    CR3_DMAT = 1 << 7,
    CR3_TXFTIE = 1 << 23,
    CR3_TXFTCFG = 29, /* 5: the interrupt comes when the FIFO is empty, once for sixteen bytes */
    ISR_ORE = 1 << 3,
    ISR_RXFNE = 1 << 5,
    ISR_TXFNF = 1 << 7,

    BLOCK = 256,
    EMPTY = 5
};

static volatile uint8_t blocks[2][BLOCK] DMA_MEMORY;

static struct {
    uintptr_t base; /* of the USART that sends by DMA; 0: none */
    unsigned filling;
    uint32_t filled;
} sender;

static volatile uint32_t *at(const uart *u, unsigned offset) {
    return (volatile uint32_t *)(u->base + offset);
}

static void start(uart *u, uintptr_t address, uint32_t clock_hz, uint32_t baud) {
    u->base = address;
    u->overruns = 0;
    *at(u, CR1) = 0;
    *at(u, BRR) = (clock_hz + baud / 2) / baud;
}

void stm32h7_usart_start(uart *u, uintptr_t address, uint32_t clock_hz, uint32_t baud) {
    start(u, address, clock_hz, baud);
    *at(u, CR3) = (uint32_t)EMPTY << CR3_TXFTCFG;
    *at(u, CR1) = CR1_FIFOEN | CR1_UE | CR1_TE | CR1_RE;
}

void stm32h7_usart_start_sender(uart *u, uintptr_t address, uint32_t clock_hz, uint32_t baud,
                                uint32_t request) {
    start(u, address, clock_hz, baud);
    *at(u, CR3) = CR3_DMAT;
    *at(u, CR1) = CR1_UE | CR1_TE;
    sender.base = address;
    sender.filling = 0;
    sender.filled = 0;
    DMAMUX1_CR(TELEMETRY_STREAM) = request;
    DMA1_PAR(TELEMETRY_STREAM) = (uint32_t)(address + TDR);
}

bool uart_take(uart *u, uint8_t *byte) {
    const uint32_t status = *at(u, ISR);
    if ((status & ISR_ORE) != 0) {
        ++u->overruns;
        *at(u, ICR) = ISR_ORE;
    }
    if ((status & ISR_RXFNE) == 0) {
        return false;
    }
    *byte = (uint8_t)*at(u, RDR);
    return true;
}

bool uart_give(uart *u, uint8_t byte) {
    if (u->base == sender.base) {
        if (sender.filled == BLOCK) {
            return false;
        }
        blocks[sender.filling][sender.filled++] = byte;
        return true;
    }
    if ((*at(u, ISR) & ISR_TXFNF) == 0) {
        return false;
    }
    *at(u, TDR) = byte;
    return true;
}

void uart_receive_irq(uart *u, bool on) {
    if (u->base != sender.base) {
        *at(u, CR1) = on ? *at(u, CR1) | CR1_RXFNEIE : *at(u, CR1) & ~(uint32_t)CR1_RXFNEIE;
    }
}

/* A stream that is through clears its EN by itself; the flags of the last block must go before the next. */
static void send_block(void) {
    if (sender.filled == 0 || (DMA1_CR(TELEMETRY_STREAM) & DMA_EN) != 0) {
        return;
    }
    core_write_barrier();
    DMA1_LIFCR = DMA_FLAGS_1;
    DMA1_M0AR(TELEMETRY_STREAM) = (uint32_t)(uintptr_t)blocks[sender.filling];
    DMA1_NDTR(TELEMETRY_STREAM) = sender.filled;
    DMA1_CR(TELEMETRY_STREAM) = DMA_BUFFERABLE | DMA_MINC | DMA_TO_PERIPHERAL | DMA_TCIE;
    DMA1_CR(TELEMETRY_STREAM) |= DMA_EN;
    sender.filling ^= 1U;
    sender.filled = 0;
}

/* serial.c calls it after each round of uart_give, from the interrupt and from the loop. */
void uart_transmit_irq(uart *u, bool on) {
    if (u->base == sender.base) {
        send_block();
        return;
    }
    *at(u, CR3) = on ? *at(u, CR3) | CR3_TXFTIE : *at(u, CR3) & ~(uint32_t)CR3_TXFTIE;
}

void uart_acknowledge(uart *u) {
    if (u->base == sender.base) {
        DMA1_LIFCR = DMA_FLAGS_1;
    }
}
