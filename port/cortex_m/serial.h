// SPDX-License-Identifier: MIT
/*
 * The link's byte stream: a ring buffer each way, filled and emptied by interrupt. Nothing here
 * waits, except serial_panic.
 *
 * When the receive ring is full, its interrupt is switched off until there is room: nothing is
 * thrown away that the sender's side could still hold back. docs/PORTING.md, "Flow control".
 */
#ifndef PELORUS_CORTEX_M_SERIAL_H
#define PELORUS_CORTEX_M_SERIAL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    SERIAL_RECEIVE_SIZE = 4096, /* powers of two */
    SERIAL_TRANSMIT_SIZE = 4096
};

/* Empties both rings and switches reception on. */
void serial_start(void);

/* Takes up to n received bytes; returns how many. */
size_t serial_read(uint8_t *bytes, size_t n);

/* Queues all n bytes, or none and returns false. */
bool serial_write(const uint8_t *bytes, size_t n);

/* Room in the transmit ring, in bytes. */
size_t serial_room(void);

/* Sends by polling what the transmitter takes at once. Where the transmit interrupt works this is
 * a byte or two; where an emulator does not model it, this is the transmission. */
void serial_pump(void);

/* Sleeps until the next interrupt, unless a received byte waits or bytes must be pumped. */
void serial_sleep(void);

/* Sends by polling alone, with interrupts masked, for a fault handler: first what was queued, then
 * these bytes. Bounded: gives up when the transmitter takes nothing for a long time. */
void serial_panic(const uint8_t *bytes, size_t n);

/* The board's vector table points its UART interrupts here. */
void serial_isr(void);

#endif
