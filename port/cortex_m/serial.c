// SPDX-License-Identifier: MIT
#include "serial.h"

#include "core.h"
#include "uart.h"

/* One side writes `head`, the other `tail`; both count bytes since start and wrap by themselves. */
static volatile uint8_t receive_ring[SERIAL_RECEIVE_SIZE];
static volatile uint32_t receive_head, receive_tail;
static volatile uint8_t transmit_ring[SERIAL_TRANSMIT_SIZE];
static volatile uint32_t transmit_head, transmit_tail;
static volatile bool receive_held;       /* the receive interrupt is off for want of room */
static volatile bool transmit_irq_works; /* it has fired at least once */

/* A transmitter that is stuck for so many polls will not come back: at 9600 baud and 400 MHz a byte
 * takes about 4e5 cycles. */
enum { PANIC_POLLS = 2000000 };

static void receive_all(void) {
    while (receive_head - receive_tail < SERIAL_RECEIVE_SIZE) {
        uint8_t byte;
        if (!uart_take(&byte)) {
            return;
        }
        receive_ring[receive_head % SERIAL_RECEIVE_SIZE] = byte;
        ++receive_head;
    }
    receive_held = true;
    uart_receive_irq(false);
}

static void transmit_some(void) {
    while (transmit_tail != transmit_head &&
           uart_give(transmit_ring[transmit_tail % SERIAL_TRANSMIT_SIZE])) {
        ++transmit_tail;
    }
    uart_transmit_irq(transmit_tail != transmit_head);
}

void serial_isr(void) {
    uart_acknowledge();
    receive_all();
    if (transmit_tail != transmit_head) {
        transmit_irq_works = true;
    }
    transmit_some();
}

/* With room again: the interrupt first, then a look by hand, so that a byte which came in between
 * is not left lying. */
static void resume_reception(void) {
    const uint32_t primask = core_irq_save();
    if (receive_held) {
        receive_held = false;
        uart_receive_irq(true);
        receive_all();
    }
    core_irq_restore(primask);
}

void serial_start(void) {
    receive_head = receive_tail = 0;
    transmit_head = transmit_tail = 0;
    receive_held = true;
    resume_reception();
}

size_t serial_read(uint8_t *bytes, size_t n) {
    size_t count = 0;
    while (count < n && receive_tail != receive_head) {
        bytes[count++] = receive_ring[receive_tail % SERIAL_RECEIVE_SIZE];
        ++receive_tail;
    }
    if (receive_held) {
        resume_reception();
    }
    return count;
}

size_t serial_room(void) {
    return SERIAL_TRANSMIT_SIZE - (transmit_head - transmit_tail);
}

bool serial_write(const uint8_t *bytes, size_t n) {
    if (n > serial_room()) {
        return false;
    }
    for (size_t i = 0; i < n; ++i) {
        transmit_ring[(transmit_head + i) % SERIAL_TRANSMIT_SIZE] = bytes[i];
    }
    transmit_head += n;
    serial_pump();
    return true;
}

void serial_pump(void) {
    const uint32_t primask = core_irq_save();
    transmit_some();
    core_irq_restore(primask);
}

void serial_sleep(void) {
    serial_pump();
    core_irq_off();
    const bool to_pump = transmit_tail != transmit_head && !transmit_irq_works;
    if (receive_tail == receive_head && !to_pump) {
        core_wait_for_interrupt();
    }
    core_irq_on();
}

static void panic_byte(uint8_t byte) {
    for (uint32_t polls = 0; polls < PANIC_POLLS; ++polls) {
        if (uart_give(byte)) {
            return;
        }
    }
}

void serial_panic(const uint8_t *bytes, size_t n) {
    core_irq_off();
    for (; transmit_tail != transmit_head; ++transmit_tail) {
        panic_byte(transmit_ring[transmit_tail % SERIAL_TRANSMIT_SIZE]);
    }
    for (size_t i = 0; i < n; ++i) {
        panic_byte(bytes[i]);
    }
}
