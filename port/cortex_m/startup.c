// SPDX-License-Identifier: MIT
#include "startup.h"

#include "core.h"
#include "stack_guard.h"

/* From the linker script. */
extern uint32_t _stack_guard[], _stack_bottom[];
extern uint32_t _data_load[], _data_start[], _data_end[];
extern uint32_t _bss_start[], _bss_end[];
extern uint32_t _ccm_start[], _ccm_end[]; /* of a second memory; empty on most boards */

enum { STACK_PAINT = 0x50454C4F /* "OLEP" in a memory dump */ };

void startup_main(void);

/* The coprocessor access register is set before a single line of C: a compiler is free to use the
 * FPU's registers anywhere, prologues included. */
__attribute__((naked, noreturn)) void startup_reset(void) {
    __asm volatile("cpsid i                \n"
                   "ldr   r0, =0xE000ED88  \n" /* CPACR */
                   "ldr   r1, [r0]         \n"
                   "orr   r1, #0x00F00000  \n" /* CP10 and CP11: full access */
                   "str   r1, [r0]         \n"
                   "dsb                    \n"
                   "isb                    \n"
                   "ldr   r0, =_stack_top  \n" /* a debugger's jump to reset does not load it */
                   "msr   msp, r0          \n"
                   "bl    startup_main     \n"
                   ".ltorg                 \n");
}

static void paint_stack(void) {
    volatile uint32_t *word = _stack_bottom;
    const uint32_t *here = __builtin_frame_address(0);
    /* A margin below this frame, for what the compiler may have put there. */
    while (word < here - 16) {
        *word++ = STACK_PAINT;
    }
}

static void load_data(void) {
    const volatile uint32_t *from = _data_load;
    for (volatile uint32_t *to = _data_start; to < _data_end; ++to) {
        *to = *from++;
    }
    for (volatile uint32_t *to = _bss_start; to < _bss_end; ++to) {
        *to = 0;
    }
    for (volatile uint32_t *to = _ccm_start; to < _ccm_end; ++to) {
        *to = 0;
    }
}

/* Round to nearest, no flush to zero, no default NaN; in interrupts too, whose context starts from
 * FPDSCR. The other bits stay: on Armv8.1-M they hold LTPSIZE, and a zero there turns the hardware
 * loops that the compiler likes into usage faults. */
static void set_arithmetic(void) {
    uint32_t fpscr;
    FPU_FPDSCR &= ~(uint32_t)FPSCR_MODES;
    __asm volatile("dsb\n\tisb" ::: "memory");
    __asm volatile("vmrs %0, fpscr" : "=r"(fpscr));
    fpscr &= ~(uint32_t)FPSCR_MODES;
    __asm volatile("vmsr fpscr, %0" ::"r"(fpscr));
}

__attribute__((noreturn, used)) void startup_main(void) {
    paint_stack();
    load_data();
    SCB_VTOR = (uint32_t)(uintptr_t)board_vectors;
    SCB_SHCSR |= SHCSR_FAULTS;
    SCB_CCR |= SCB_CCR_DIV_0_TRP;
    set_arithmetic();
    stack_guard_start(_stack_guard);
    (void)main();
    core_reset();
}

size_t stack_size(void) {
    return (size_t)((uintptr_t)_stack_top - (uintptr_t)_stack_bottom);
}

size_t stack_used(void) {
    const volatile uint32_t *word = _stack_bottom;
    while (word < _stack_top && *word == STACK_PAINT) {
        ++word;
    }
    return (size_t)((uintptr_t)_stack_top - (uintptr_t)word);
}
