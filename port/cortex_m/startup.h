// SPDX-License-Identifier: MIT
/* From reset to main, and what a board's vector table needs for it. */
#ifndef PELORUS_CORTEX_M_STARTUP_H
#define PELORUS_CORTEX_M_STARTUP_H

#include <stddef.h>
#include <stdint.h>

typedef void (*vector)(void);

/* A board defines it, in section .vectors: 16 system entries, then its interrupts. */
extern const vector board_vectors[];

/* The first sixteen entries, the same on every board. The linker's _stack_top is no function, but
 * the table is an array of addresses and its first one is the stack's. */
#define SYSTEM_VECTORS                                                                             \
    [0] = (vector)(uintptr_t)_stack_top, [1] = startup_reset, [2] = fault_entry,                   \
    [3] = fault_entry, [4] = fault_entry, [5] = fault_entry, [6] = fault_entry, [7] = fault_entry, \
    [11] = fault_entry, [12] = fault_entry, [14] = fault_entry, [15] = clock_isr

extern uint32_t _stack_top[];

void startup_reset(void);
void fault_entry(void);
void clock_isr(void);

/* Bytes reserved for the stack, and how many of them were ever used since reset: the stack is
 * painted before main, and the paint that is gone tells. */
size_t stack_size(void);
size_t stack_used(void);

/* The program. */
int main(void);

#endif
