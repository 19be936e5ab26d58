// SPDX-License-Identifier: MIT
#include "port_serial.h"

#include <stdbool.h>

#include "board.h"
#include "clock.h"
#include "serial.h"

/* At 921600 baud a full ring is sent in 45 ms; at 115200, in 360 ms. */
enum { STALL_NS = 500 * 1000 * 1000 };

/* True while the other side does not receive. Then writes do not wait: a cut link delays the loop
 * once and not at every write. */
static bool stalled;

static int receive(void *context, uint8_t *bytes, size_t n) {
    (void)context;
    return (int)serial_read(&serial_link, bytes, n);
}

static int transmit(void *context, const uint8_t *bytes, size_t n) {
    (void)context;
    const uint64_t start_ns = clock_ns();
    while (!serial_write(&serial_link, bytes, n)) {
        if (stalled || clock_ns() - start_ns > STALL_NS) {
            stalled = true;
            return 1;
        }
        serial_pump(&serial_link);
    }
    stalled = false;
    return 0;
}

static uint64_t now_ns(void *context) {
    (void)context;
    return clock_ns();
}

static void idle(void *context) {
    (void)context;
    serial_sleep();
}

static void feed_watchdog(void *context) {
    (void)context;
    board_watchdog_feed();
}

plr_port port_serial(void) {
    const plr_port port = {.context = NULL,
                           .read = receive,
                           .write = transmit,
                           .now_ns = now_ns,
                           .idle = idle,
                           .feed_watchdog = feed_watchdog};
    return port;
}
