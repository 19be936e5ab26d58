// SPDX-License-Identifier: MIT
/* Armv8-M (Cortex-M55): the stack pointer has a limit register. */
#include "../stack_guard.h"

void stack_guard_start(uint32_t *guard) {
    __asm volatile("msr msplim, %0" ::"r"(guard + STACK_GUARD_BYTES / 4));
}
