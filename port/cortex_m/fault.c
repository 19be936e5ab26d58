// SPDX-License-Identifier: MIT
#include "fault.h"

#include <stdbool.h>

#include "core.h"
#include "panic.h"
#include "startup.h"

enum { FAULT_STACK_WORDS = 512, RECORD_MAGIC = 0x504C5246 };

/* What the processor puts on the stack as it enters an exception. */
typedef struct stacked_registers {
    uint32_t r0, r1, r2, r3, r12, lr, pc, psr;
} stacked_registers;

/* Kept over a reset. */
typedef struct fault_record {
    uint32_t magic, count, exception, pc, status, address, check;
} fault_record;

static fault_record record __attribute__((section(".noinit")));

/* The fault may be the stack's end: its report needs another one. */
uint32_t fault_stack[FAULT_STACK_WORDS] __attribute__((section(".noinit"), aligned(8)));
uint32_t *const fault_stack_top __attribute__((used)) = fault_stack + FAULT_STACK_WORDS;

void fault_report(const stacked_registers *at);

/* Nothing may be pushed before the stack is a good one. Clearing FPCCR.LSPACT drops a lazy save of
 * FPU registers that would go to the old stack. The way back is given up. */
__attribute__((naked)) void fault_entry(void) {
    __asm volatile("cpsid i                    \n"
                   "mrs   r0, msp              \n"
                   "ldr   r1, =fault_stack_top \n"
                   "ldr   r1, [r1]             \n"
                   "msr   msp, r1              \n"
                   "ldr   r1, =0xE000EF34      \n"
                   "ldr   r2, [r1]             \n"
                   "bic   r2, #1               \n"
                   "str   r2, [r1]             \n"
                   "b     fault_report         \n"
                   ".ltorg                     \n");
}

static uint32_t record_check(const fault_record *r) {
    return r->magic ^ r->count ^ r->exception ^ r->pc ^ r->status ^ r->address ^ 0xA5A5A5A5U;
}

static bool record_valid(void) {
    return record.magic == RECORD_MAGIC && record.check == record_check(&record);
}

static void add_record(text *t) {
    static const char *const names[] = {"reset",        "reset",     "watchdog",    "hard fault",
                                        "memory fault", "bus fault", "usage fault", "secure fault"};
    const bool named = record.exception < sizeof names / sizeof names[0];
    text_add(t, named ? names[record.exception] : "unexpected exception");
    text_add(t, " at pc ");
    text_add_hex(t, record.pc);
    text_add(t, ", status ");
    text_add_hex(t, record.status);
    text_add(t, ", address ");
    text_add_hex(t, record.address);
}

static bool stack_holds(const stacked_registers *at) {
    const uintptr_t address = (uintptr_t)at;
    return address >= (uintptr_t)_stack_top - stack_size() &&
           address <= (uintptr_t)_stack_top - sizeof *at;
}

__attribute__((noreturn, used)) void fault_report(const stacked_registers *at) {
    static text message;
    uint32_t exception;
    __asm volatile("mrs %0, ipsr" : "=r"(exception));
    const uint32_t count = record_valid() ? record.count + 1 : 1;
    const bool overflow = !stack_holds(at) || (SCB_CFSR & CFSR_STACK) != 0;
    record = (fault_record){.magic = RECORD_MAGIC,
                            .count = count,
                            .exception = exception,
                            .pc = overflow ? 0 : at->pc,
                            .status = SCB_CFSR,
                            .address = (SCB_CFSR & CFSR_MMARVALID) != 0 ? SCB_MMFAR : SCB_BFAR};
    record.check = record_check(&record);
    text_clear(&message);
    if (overflow) {
        text_add(&message, "stack overflow: ");
    }
    add_record(&message);
    text_add(&message, "; resetting");
    panic_text(message.characters);
    core_reset();
}

uint32_t fault_count(void) {
    return record_valid() ? record.count : 0;
}

void fault_add_history(text *t) {
    if (!record_valid()) {
        text_add(t, "power-on");
        return;
    }
    text_add(t, "reset after ");
    add_record(t);
    text_add(t, ", fault ");
    text_add_number(t, record.count);
    text_add(t, " since power-on");
}
