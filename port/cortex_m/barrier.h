// SPDX-License-Identifier: MIT
/* The order in which memory is handed over between an interrupt and the loop. */
#ifndef PELORUS_CORTEX_M_BARRIER_H
#define PELORUS_CORTEX_M_BARRIER_H

/* The compiler moves no access to memory across it. C orders volatile accesses among themselves alone: what is handed
 * over by a volatile index or state may otherwise be written after it, or read before. On one core the processor needs
 * no instruction for that; before a DMA it does (core_write_barrier in core.h). */
static inline void compiler_barrier(void) {
    __asm volatile("" ::: "memory");
}

#endif
