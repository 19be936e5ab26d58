// SPDX-License-Identifier: MIT
/* A progress line on the terminal; nothing if stderr is not a terminal. */
#ifndef PELORUS_POSIX_PROGRESS_H
#define PELORUS_POSIX_PROGRESS_H

#include <stdbool.h>
#include <stdint.h>

typedef struct progress {
    bool shown;
    uint64_t total_bytes; /* 0: not known */
    uint64_t start_ns, drawn_ns;
} progress;

void progress_begin(progress *p, bool wanted, uint64_t total_bytes);

/* Draws the line anew, at most ten times a second. */
void progress_show(progress *p, uint64_t bytes, uint64_t frames);

/* Removes the line: call it before anything else is printed, and at the end. */
void progress_clear(const progress *p);

#endif
