// SPDX-License-Identifier: MIT
/*
 * Serial ports: a ring buffer each way, filled and emptied by interrupt. Nothing here waits, except
 * serial_panic. There are two: the link, which the session talks over, and telemetry, which only
 * sends.
 *
 * When the link's receive ring is full, its interrupt is switched off until there is room, so that
 * a sender with flow control waits and no byte is lost. docs/PORTING.md, "Flow control".
 */
#ifndef PELORUS_CORTEX_M_SERIAL_H
#define PELORUS_CORTEX_M_SERIAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "uart.h"

enum {
    SERIAL_LINK_SIZE = 4096, /* bytes each way; powers of two */
    SERIAL_TELEMETRY_SIZE = 1024
};

/* One side moves `head`, the other `tail`; both count bytes since start and wrap by themselves. */
typedef struct serial_ring {
    volatile uint8_t *bytes;
    uint32_t size; /* a power of two; 0: this way is closed */
    volatile uint32_t head, tail;
} serial_ring;

typedef struct serial {
    uart uart;
    serial_ring in, out;
    volatile bool receive_held;       /* the receive interrupt is off for want of room */
    volatile bool transmit_irq_works; /* it has fired at least once */
} serial;

extern serial serial_link, serial_telemetry;

/* Empties both rings and switches reception on. */
void serial_start(serial *s);

/* Takes up to n received bytes; returns how many. */
size_t serial_read(serial *s, uint8_t *bytes, size_t n);

/* Queues all n bytes, or none and returns false. */
bool serial_write(serial *s, const uint8_t *bytes, size_t n);

/* Sends by polling what the transmitter takes at once. Where the transmit interrupt works this is
 * a byte or two; where an emulator does not model it, this is the transmission. */
void serial_pump(serial *s);

/* Sleeps until the next interrupt, unless a received byte waits or bytes must be pumped. */
void serial_sleep(void);

/* Sends over the link by polling alone, with interrupts masked, for a fault handler: first what was
 * queued, then these bytes. Bounded: gives up a byte that the transmitter does not take for a long
 * time. */
void serial_panic(const uint8_t *bytes, size_t n);

/* The board's vector table points its UART interrupts here. */
void serial_link_isr(void);
void serial_telemetry_isr(void);

#endif
