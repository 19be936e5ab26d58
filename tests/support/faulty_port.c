// SPDX-License-Identifier: MIT
#include "support/faulty_port.h"

#include <string.h>

static int append(uint8_t *bytes, size_t *count, const uint8_t *more, size_t n) {
    if (n > FAULTY_PORT_BYTES - *count)
        return -1;
    memcpy(bytes + *count, more, n);
    *count += n;
    return 0;
}

static int send_from_writer(void *context, const uint8_t *bytes, size_t n) {
    faulty_port *port = context;
    return append(port->sent, &port->sent_count, bytes, n);
}

static void start_receiver(faulty_port *port) {
    (void)plr_reader_init(&port->receiver, port->body, sizeof port->body, port->observations,
                          PLR_WIRE_MAX_OBSERVATIONS);
    port->answer_at = 0;
}

void faulty_port_init(faulty_port *port, uint64_t seed) {
    memset(port, 0, sizeof *port);
    port->random = rng_seeded(seed);
    port->clock_step_ns = 1000;
    (void)plr_writer_init(&port->sender, send_from_writer, port);
    start_receiver(port);
}

static bool happens(faulty_port *port, double share) {
    return share > 0 && rng_uniform(&port->random, 0, 1) < share;
}

/* The next byte as it arrives; false at the end. */
static bool next_byte(faulty_port *port, uint8_t *byte) {
    while (port->sent_at < port->sent_count) {
        *byte = port->sent[port->sent_at];
        if (!port->pending && happens(port, port->lost_share)) {
            port->sent_at++;
            continue;
        }
        port->pending = !port->pending && happens(port, port->doubled_share);
        if (!port->pending)
            port->sent_at++;
        if (happens(port, port->damaged_share))
            *byte = (uint8_t)(*byte ^ (1u << rng_below(&port->random, 8)));
        return true;
    }
    return false;
}

static int read_bytes(void *context, uint8_t *bytes, size_t n) {
    faulty_port *port = context;
    size_t most = n;
    int count = 0;
    if (happens(port, port->nothing_share))
        return PLR_PORT_NOTHING;
    if (port->most_at_once > 0 && port->most_at_once < n)
        most = 1 + rng_below(&port->random, port->most_at_once);
    while ((size_t)count < most && next_byte(port, bytes + count))
        count++;
    if (count > 0)
        return count;
    if (port->fails)
        return PLR_PORT_FAILED;
    return port->stays_open ? PLR_PORT_NOTHING : PLR_PORT_CLOSED;
}

static int write_bytes(void *context, const uint8_t *bytes, size_t n) {
    faulty_port *port = context;
    if (happens(port, port->refused_share)) {
        (void)append(port->answers, &port->answer_count, bytes,
                     rng_below(&port->random, (unsigned)n));
        return -1;
    }
    return append(port->answers, &port->answer_count, bytes, n);
}

static uint64_t now_ns(void *context) {
    faulty_port *port = context;
    port->now_ns += port->clock_step_ns;
    if (++port->clock_calls == port->clock_jump_at)
        port->now_ns += port->clock_jump_ns;
    return port->now_ns;
}

static void idle(void *context) {
    ((faulty_port *)context)->idles++;
}

static void feed_watchdog(void *context) {
    ((faulty_port *)context)->feeds++;
}

plr_port faulty_port_functions(faulty_port *port) {
    return (plr_port){.context = port,
                      .read = read_bytes,
                      .write = write_bytes,
                      .now_ns = now_ns,
                      .idle = idle,
                      .feed_watchdog = feed_watchdog};
}

void faulty_port_send(faulty_port *port, const plr_message *message) {
    (void)plr_writer_put(&port->sender, message);
}

void faulty_port_send_bytes(faulty_port *port, const uint8_t *bytes, size_t n) {
    (void)append(port->sent, &port->sent_count, bytes, n);
}

bool faulty_port_answer(faulty_port *port, plr_message *answer) {
    while (port->answer_at < port->answer_count) {
        size_t taken = 0;
        const plr_read_event event =
            plr_reader_feed(&port->receiver, port->answers + port->answer_at,
                            port->answer_count - port->answer_at, &taken, answer);
        port->answer_at += taken;
        if (event == PLR_READ_MESSAGE)
            return true;
    }
    return false;
}

bool faulty_port_answer_of(faulty_port *port, plr_kind kind, plr_message *answer) {
    while (faulty_port_answer(port, answer))
        if (answer->kind == kind)
            return true;
    return false;
}

void faulty_port_answers_again(faulty_port *port) {
    start_receiver(port);
}
