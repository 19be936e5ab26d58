// SPDX-License-Identifier: MIT
/* Makes running over the stack's end a fault at once. How depends on the processor: one of
 * drivers/stack_guard_*.c. */
#ifndef PELORUS_CORTEX_M_STACK_GUARD_H
#define PELORUS_CORTEX_M_STACK_GUARD_H

#include <stdint.h>

/* Bytes below the stack that sections.ld sets aside, aligned to their number. A function whose
 * frame is larger could step over them. */
enum { STACK_GUARD_BYTES = 1024 };

void stack_guard_start(uint32_t *guard);

#endif
