// SPDX-License-Identifier: MIT
/* The independent watchdog of the STM32 families: RM0090, section 21.4; RM0433, section 46.4. */
#ifndef PELORUS_CORTEX_M_STM32_IWDG_H
#define PELORUS_CORTEX_M_STM32_IWDG_H

#include <stdint.h>

#include "../core.h"

/* Resets the part after so many periods of 64 clocks of the watchdog's own oscillator without a feed. */
static inline void stm32_iwdg_start(uint32_t base, uint32_t periods) {
    CORE_REGISTER(base) = 0x5555; /* KR: opens PR and RLR */
    CORE_REGISTER(base + 4) = 4;  /* PR: by 64 */
    CORE_REGISTER(base + 8) = periods - 1;
    CORE_REGISTER(base) = 0xCCCC;
}

static inline void stm32_iwdg_feed(uint32_t base) {
    CORE_REGISTER(base) = 0xAAAA;
}

#endif
