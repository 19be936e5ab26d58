// SPDX-License-Identifier: MIT
/*
 * What the session needs of the machine it runs on: bytes in, bytes out, and, where there is one,
 * a clock. A new board supplies these functions and nothing else: docs/PORTING.md.
 *
 * Each function gets the `context` that stands beside it; two sessions on two ports can live side
 * by side. None of them may call the session back, and none may wait for long: the session's loop
 * is as alive as its port. What a function returns is written down here, and everything else that
 * it might do (short reads, lost or damaged bytes, a clock that stalls or jumps) the session
 * survives.
 */
#ifndef PELORUS_PORT_H
#define PELORUS_PORT_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What plr_port.read returns besides a number of bytes. */
enum {
    PLR_PORT_NOTHING = 0, /* no byte now; later perhaps */
    PLR_PORT_CLOSED = -1, /* the stream has ended: a file's end, a closed connection */
    PLR_PORT_FAILED = -2  /* the machine reports a failure */
};

/* Bytes and time. */
typedef struct plr_port {
    void *context; /* handed to every function; may be NULL */

    /* Copies up to n bytes (n is 1 to 256), as many as are there now. Returns their number, 1 to n,
     * or one of the above. Does not wait on a board; on a desktop it may. */
    int (*read)(void *context, uint8_t *bytes, size_t n);

    /* Takes all n bytes (n is 1 to 256) and returns 0, or gives up and returns anything else. A
     * link that is cut gives up within a bounded time: the frame is lost and counted, the loop
     * goes on. NULL: there is no output. */
    int (*write)(void *context, const uint8_t *bytes, size_t n);

    /* Nanoseconds of a clock whose zero does not matter. It measures how long a frame takes, for
     * the REPORT and for the deadline; no estimate depends on it. NULL: there is no clock, times
     * are reported as 0 and a deadline cannot be kept. */
    uint64_t (*now_ns)(void *context);

    /* Called when there was nothing to read: sleep until the next interrupt (WFI), or do nothing.
     * NULL: the session spins. */
    void (*idle)(void *context);

    /* Called once in every step, whatever it met: tells a watchdog that the loop is alive. NULL:
     * there is none. */
    void (*feed_watchdog)(void *context);
} plr_port;

/* Storage that survives a power cut: a flash sector, a file. Offsets and lengths are in bytes from
 * the device's start. Every function returns 0, or a negative number for a failure. Reading back
 * what was erased and not programmed gives any value, but always the same. */
typedef struct plr_block_device {
    void *context;         /* handed to every function; may be NULL */
    uint32_t size;         /* of the whole device; a multiple of erase_size */
    uint32_t erase_size;   /* smallest erasable unit; a multiple of program_size */
    uint32_t program_size; /* smallest programmable unit, 1 to 256 */

    /* Any offset and length inside the device. */
    int (*read)(void *context, uint32_t offset, uint8_t *bytes, uint32_t n);

    /* Offset and length are multiples of program_size, inside what was erased before. May be cut
     * by a power failure at any byte: what is then there is undefined. */
    int (*program)(void *context, uint32_t offset, const uint8_t *bytes, uint32_t n);

    /* Offset and length are multiples of erase_size. */
    int (*erase)(void *context, uint32_t offset, uint32_t n);
} plr_block_device;

#ifdef __cplusplus
}
#endif

#endif
