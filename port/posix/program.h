// SPDX-License-Identifier: MIT
/* What differs between programs that run a filter over a recording: pelorus-replay, and
 * pelorus-textbook, which has a program.c of its own. */
#ifndef PELORUS_POSIX_PROGRAM_H
#define PELORUS_POSIX_PROGRAM_H

#include <stddef.h>

#include "pelorus/settings.h"

/* What the program does, for its help text: whole lines. */
extern const char program_about[];

/* How many landmarks it holds, as words: "100 slots". */
void program_capacity(const plr_config *config, char *text, size_t size);

#endif
