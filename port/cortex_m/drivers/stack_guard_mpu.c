// SPDX-License-Identifier: MIT
/* Armv7-M (Cortex-M4, M7): a region of the memory protection unit that nobody may touch. */
#include "../core.h"
#include "../stack_guard.h"

enum {
    CTRL_ENABLE = 1 << 0,
    CTRL_ELSE_AS_USUAL = 1 << 2, /* PRIVDEFENA: the default memory map outside the regions */
    RASR_ENABLE = 1 << 0,
    RASR_SIZE_1024 = 9 << 1, /* 2^(9 + 1) */
    RASR_NO_EXECUTE = 1 << 28
};

void stack_guard_start(uint32_t *guard) {
    MPU_RNR = 0;
    MPU_RBAR = (uint32_t)(uintptr_t)guard;
    MPU_RASR = RASR_NO_EXECUTE | RASR_SIZE_1024 | RASR_ENABLE; /* access permission 0: none */
    MPU_CTRL = CTRL_ELSE_AS_USUAL | CTRL_ENABLE;
    __asm volatile("dsb\n\tisb" ::: "memory");
}
