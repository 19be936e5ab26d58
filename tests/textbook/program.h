// SPDX-License-Identifier: MIT
/* What pelorus-textbook's parts tell one another. The program is the replay, with plr_filter_* from
 * filter.c here in the place of the library's: one textbook filter, so one session. */
#ifndef PELORUS_TEXTBOOK_PROGRAM_H
#define PELORUS_TEXTBOOK_PROGRAM_H

#include "textbook/textbook.h"

/* How many landmarks and observations a frame plr_filter_init makes room for. To be called before. */
void textbook_program_reserve(unsigned landmarks, unsigned observations);

/* Bytes that this process can still have: what the machine has free (MemAvailable) and what its limits
 * (RLIMIT_AS, a control group's memory.max) leave it. SIZE_MAX where nothing can be found out. */
size_t textbook_program_memory(void);

#endif
