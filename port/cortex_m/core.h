// SPDX-License-Identifier: MIT
/*
 * The registers that every Cortex-M4, M7 and M55 has, and the few instructions that cannot be
 * written in C. Addresses and bits: Armv7-M and Armv8-M Architecture Reference Manuals, System
 * Control Space.
 */
#ifndef PELORUS_CORTEX_M_CORE_H
#define PELORUS_CORTEX_M_CORE_H

#include <stdint.h>

#define CORE_REGISTER(address) (*(volatile uint32_t *)(uintptr_t)(address))

#define SYST_CSR   CORE_REGISTER(0xE000E010U)
#define SYST_RVR   CORE_REGISTER(0xE000E014U)
#define SYST_CVR   CORE_REGISTER(0xE000E018U)
#define NVIC_ISER  ((volatile uint32_t *)(uintptr_t)0xE000E100U)
#define SCB_ICSR   CORE_REGISTER(0xE000ED04U)
#define SCB_VTOR   CORE_REGISTER(0xE000ED08U)
#define SCB_AIRCR  CORE_REGISTER(0xE000ED0CU)
#define SCB_CCR    CORE_REGISTER(0xE000ED14U)
#define SCB_SHCSR  CORE_REGISTER(0xE000ED24U)
#define SCB_CFSR   CORE_REGISTER(0xE000ED28U)
#define SCB_HFSR   CORE_REGISTER(0xE000ED2CU)
#define SCB_MMFAR  CORE_REGISTER(0xE000ED34U)
#define SCB_BFAR   CORE_REGISTER(0xE000ED38U)
#define FPU_FPDSCR CORE_REGISTER(0xE000EF3CU)

/* Memory protection unit of an Armv7-M. */
#define MPU_CTRL CORE_REGISTER(0xE000ED94U)
#define MPU_RNR  CORE_REGISTER(0xE000ED98U)
#define MPU_RBAR CORE_REGISTER(0xE000ED9CU)
#define MPU_RASR CORE_REGISTER(0xE000EDA0U)

enum {
    SYST_CSR_ENABLE = 1 << 0,
    SYST_CSR_TICKINT = 1 << 1,
    SYST_CSR_CORE_CLOCK = 1 << 2,
    SYST_MAX = 0x00FFFFFF, /* it counts 24 bits */
    ICSR_PENDSTSET = 1 << 26,
    FPSCR_MODES = 0x1F << 22 | 1 << 19, /* AHP, DN, FZ, rounding; FZ16 */
    SCB_CCR_DIV_0_TRP = 1 << 4,
    SHCSR_FAULTS = 7 << 16,  /* memory, bus and usage faults have handlers of their own */
    CFSR_MMARVALID = 1 << 7, /* MMFAR holds an address */
    CFSR_STACK = 1 << 4 | 1 << 12 | 1 << 20, /* MSTKERR, STKERR, STKOF: no room to save registers */
    CORE_EXCEPTIONS = 16 /* entries of the vector table before the first interrupt */
};

#define AIRCR_RESET 0x05FA0004U /* key and SYSRESETREQ */

static inline void core_irq_off(void) {
    __asm volatile("cpsid i" ::: "memory");
}

static inline void core_irq_on(void) {
    __asm volatile("cpsie i" ::: "memory");
}

/* Masks interrupts and returns the previous mask, for core_irq_restore. */
static inline uint32_t core_irq_save(void) {
    uint32_t primask;
    __asm volatile("mrs %0, primask\n\tcpsid i" : "=r"(primask)::"memory");
    return primask;
}

static inline void core_irq_restore(uint32_t primask) {
    __asm volatile("msr primask, %0" ::"r"(primask) : "memory");
}

/* Sleeps until an interrupt is pending, also while they are masked: that closes the gap between
 * looking for work and falling asleep. */
static inline void core_wait_for_interrupt(void) {
    __asm volatile("dsb\n\twfi" ::: "memory");
}

/* Completes all writes before the next instruction. */
static inline void core_write_barrier(void) {
    __asm volatile("dsb" ::: "memory");
}

static inline void core_enable_irq(unsigned number) {
    NVIC_ISER[number / 32] = 1U << (number % 32);
}

__attribute__((noreturn)) static inline void core_reset(void) {
    __asm volatile("dsb" ::: "memory");
    SCB_AIRCR = AIRCR_RESET;
    for (;;) {
    }
}

#endif
