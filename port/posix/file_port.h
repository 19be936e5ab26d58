// SPDX-License-Identifier: MIT
/* The session's port over files: a recording in, a flight log out, a monotonic clock. */
#ifndef PELORUS_POSIX_FILE_PORT_H
#define PELORUS_POSIX_FILE_PORT_H

#include <stdbool.h>
#include <stdio.h>

#include "pelorus/port.h"
#include "posix/compressed.h"

typedef struct file_port {
    int input; /* file descriptor */
    uint8_t buffer[1 << 16];
    size_t at, count;
    uint64_t size;   /* of the input; 0 where it is not known */
    bool begun;      /* its first bytes have been looked at */
    uint8_t head[4]; /* those, until they are handed on */
    size_t head_at, head_count;
    compressed_input *unpacker; /* NULL: the input is as it is */
    int read_error;             /* errno, 0 while all is well */
    bool cut;                   /* compressed, and ended in the midst */
    const char *read_problem;   /* what no errno says, NULL while all is well */
    FILE *output;               /* NULL: none */
    compressed_output *packer;  /* NULL: the output is written as it is */
    int write_error;            /* errno */
} file_port;

/* Opens the input; "-" is the standard input. What is compressed by zstd is decompressed, whatever its
 * name. False, with errno, if that fails. */
bool file_port_open(file_port *port, const char *path);
void file_port_close(file_port *port);

/* Why reading has failed; NULL if it has not. */
const char *file_port_problem(const file_port *port);

/* The functions over it. The output, if any, is `output`. */
plr_port file_port_functions(file_port *port);

/* Nanoseconds of the monotonic clock. */
uint64_t monotonic_ns(void);

#endif
