// SPDX-License-Identifier: MIT
/* The session's port over files: a recording in, a flight log out, a monotonic clock. */
#ifndef PELORUS_POSIX_FILE_PORT_H
#define PELORUS_POSIX_FILE_PORT_H

#include <stdbool.h>
#include <stdio.h>

#include "pelorus/port.h"

typedef struct file_port {
    int input; /* file descriptor */
    uint8_t buffer[1 << 16];
    size_t at, count;
    uint64_t size;   /* of the input; 0 where it is not known */
    int read_error;  /* errno, 0 while all is well */
    FILE *output;    /* NULL: none */
    int write_error; /* errno */
} file_port;

/* Opens the input; "-" is the standard input. False, with errno, if that fails. */
bool file_port_open(file_port *port, const char *path);
void file_port_close(file_port *port);

/* The functions over it. The output, if any, is `output`. */
plr_port file_port_functions(file_port *port);

/* Nanoseconds of the monotonic clock. */
uint64_t monotonic_ns(void);

#endif
