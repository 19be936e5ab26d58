// SPDX-License-Identifier: MIT
#include "serial.h"

#include "core.h"

static volatile uint8_t link_in[SERIAL_LINK_SIZE], link_out[SERIAL_LINK_SIZE];
static volatile uint8_t telemetry_out[SERIAL_TELEMETRY_SIZE];

serial serial_link = {.in = {.bytes = link_in, .size = SERIAL_LINK_SIZE},
                      .out = {.bytes = link_out, .size = SERIAL_LINK_SIZE}};
serial serial_telemetry = {.out = {.bytes = telemetry_out, .size = SERIAL_TELEMETRY_SIZE}};

/* A transmitter that is stuck for so many polls will not come back: at 9600 baud and 400 MHz a byte
 * takes about 4e5 cycles. */
enum { PANIC_POLLS = 2000000 };

static bool is_empty(const serial_ring *ring) {
    return ring->head == ring->tail;
}

static uint32_t room(const serial_ring *ring) {
    return ring->size - (ring->head - ring->tail);
}

static void push(serial_ring *ring, uint8_t byte) {
    ring->bytes[ring->head & (ring->size - 1)] = byte;
    ++ring->head;
}

static uint8_t oldest(const serial_ring *ring) {
    return ring->bytes[ring->tail & (ring->size - 1)];
}

static void receive_all(serial *s) {
    while (room(&s->in) > 0) {
        uint8_t byte;
        if (!uart_take(&s->uart, &byte)) {
            return;
        }
        push(&s->in, byte);
    }
    s->receive_held = true;
    uart_receive_irq(&s->uart, false);
}

static void transmit_some(serial *s) {
    while (!is_empty(&s->out) && uart_give(&s->uart, oldest(&s->out))) {
        ++s->out.tail;
    }
    uart_transmit_irq(&s->uart, !is_empty(&s->out));
}

static void serve(serial *s) {
    uart_acknowledge(&s->uart);
    receive_all(s);
    if (!is_empty(&s->out)) {
        s->transmit_irq_works = true;
    }
    transmit_some(s);
}

void serial_link_isr(void) {
    serve(&serial_link);
}

void serial_telemetry_isr(void) {
    serve(&serial_telemetry);
}

/* With room again: the interrupt first, then a look by hand, so that a byte which came in between
 * is not left lying. */
static void resume_reception(serial *s) {
    const uint32_t primask = core_irq_save();
    if (s->receive_held && room(&s->in) > 0) {
        s->receive_held = false;
        uart_receive_irq(&s->uart, true);
        receive_all(s);
    }
    core_irq_restore(primask);
}

void serial_start(serial *s) {
    s->in.head = s->in.tail = 0;
    s->out.head = s->out.tail = 0;
    s->receive_held = true;
    resume_reception(s);
}

size_t serial_read(serial *s, uint8_t *bytes, size_t n) {
    size_t count = 0;
    while (count < n && !is_empty(&s->in)) {
        bytes[count++] = oldest(&s->in);
        ++s->in.tail;
    }
    if (s->receive_held) {
        resume_reception(s);
    }
    return count;
}

bool serial_write(serial *s, const uint8_t *bytes, size_t n) {
    if (n > room(&s->out)) {
        return false;
    }
    for (size_t i = 0; i < n; ++i) {
        push(&s->out, bytes[i]);
    }
    serial_pump(s);
    return true;
}

void serial_pump(serial *s) {
    const uint32_t primask = core_irq_save();
    transmit_some(s);
    core_irq_restore(primask);
}

static bool must_pump(const serial *s) {
    return !is_empty(&s->out) && !s->transmit_irq_works;
}

void serial_sleep(void) {
    serial_pump(&serial_link);
    serial_pump(&serial_telemetry);
    core_irq_off();
    if (is_empty(&serial_link.in) && !must_pump(&serial_link) && !must_pump(&serial_telemetry)) {
        core_wait_for_interrupt();
    }
    core_irq_on();
}

static void panic_byte(uint8_t byte) {
    for (uint32_t polls = 0; polls < PANIC_POLLS; ++polls) {
        if (uart_give(&serial_link.uart, byte)) {
            return;
        }
    }
}

void serial_panic(const uint8_t *bytes, size_t n) {
    core_irq_off();
    if (serial_link.uart.base == 0) {
        return; /* a fault before board_init: there is nobody to tell */
    }
    for (; !is_empty(&serial_link.out); ++serial_link.out.tail) {
        panic_byte(oldest(&serial_link.out));
    }
    for (size_t i = 0; i < n; ++i) {
        panic_byte(bytes[i]);
    }
}
