// SPDX-License-Identifier: MIT
/*
 * What a session needs of the machine it runs on: bytes in, bytes out and, where there is one, a
 * clock. A new board supplies these functions and nothing else: docs/PORTING.md.
 *
 * Each function is called with the `context` of its struct, so a program may have several sessions
 * on several ports. None of them may call the session, and none may wait for long, because the
 * session does nothing while it waits. The session tolerates short reads, lost or damaged bytes,
 * and a clock that stops or jumps.
 */
#ifndef PELORUS_PORT_H
#define PELORUS_PORT_H

#include <stddef.h>
#include <stdint.h>

/* What plr_port.read returns if it returns no bytes. */
enum {
    PLR_PORT_NOTHING = 0, /* no byte is there now */
    PLR_PORT_CLOSED = -1, /* there will be no more: end of a file, closed connection */
    PLR_PORT_FAILED = -2  /* the machine reports a failure */
};

/* Link, clock and watchdog. */
typedef struct plr_port {
    void *context; /* handed to every function; may be NULL */

    /* Copies up to n received bytes (1 to 256), as many as are there now. Returns their number, or
     * one of the values above. On a board it must not wait; on a desktop it may. */
    int (*read)(void *context, uint8_t *bytes, size_t n);

    /* Sends or queues all n bytes (1 to 256) and returns 0. On failure returns anything else, in
     * bounded time: the message is counted as lost. NULL: there is no output. */
    int (*write)(void *context, const uint8_t *bytes, size_t n);

    /* Nanoseconds of a clock whose zero does not matter. It measures how long a frame takes, for
     * the REPORT and for the deadline; no estimate depends on it. NULL: there is no clock, times
     * are reported as 0 and a deadline cannot be kept. */
    uint64_t (*now_ns)(void *context);

    /* Called when there was nothing to read; may sleep until an interrupt (WFI). May be NULL. */
    void (*idle)(void *context);

    /* Called once in every plr_session_step: feeds a watchdog. NULL: there is none. */
    void (*feed_watchdog)(void *context);
} plr_port;

/* Storage that survives a power cut: a flash sector, a file. Offsets and lengths are in bytes from
 * the device's start. Every function returns 0, or a negative number for a failure. Bytes that are
 * erased and not programmed may read as any value, but every time as the same one. */
typedef struct plr_block_device {
    void *context;         /* handed to every function; may be NULL */
    uint32_t size;         /* of the whole device; a multiple of erase_size */
    uint32_t erase_size;   /* smallest erasable unit; a multiple of program_size */
    uint32_t program_size; /* smallest programmable unit, 1 to 256 */

    /* Reads n bytes at any offset inside the device. */
    int (*read)(void *context, uint32_t offset, uint8_t *bytes, uint32_t n);

    /* Writes n bytes. Offset and length are multiples of program_size, in an erased place. If the
     * power fails meanwhile, these bytes may hold anything. */
    int (*program)(void *context, uint32_t offset, const uint8_t *bytes, uint32_t n);

    /* Erases n bytes. Offset and length are multiples of erase_size. */
    int (*erase)(void *context, uint32_t offset, uint32_t n);
} plr_block_device;

#endif
