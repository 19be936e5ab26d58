// SPDX-License-Identifier: MIT
#include "clock.h"

#include <stdbool.h>

#include "core.h"
#include "startup.h"

enum { TICKS_PER_SECOND = 1000 };

static volatile uint64_t elapsed; /* core clocks, up to the last reload */
static uint32_t period;           /* core clocks per reload */
static uint32_t frequency;

void clock_isr(void) {
    elapsed += period;
}

void clock_start(uint32_t core_hz) {
    frequency = core_hz;
    period = core_hz / TICKS_PER_SECOND;
    elapsed = 0;
    SYST_RVR = period - 1;
    SYST_CVR = 0;
    SYST_CSR = SYST_CSR_ENABLE | SYST_CSR_TICKINT | SYST_CSR_CORE_CLOCK;
}

/* Core clocks since clock_start. The counter runs from period - 1 down to 0; its interrupt is requested
 * as it gets to 0. */
static uint64_t clock_ticks(void) {
    const uint32_t primask = core_irq_save();
    uint32_t left = SYST_CVR;
    const bool requested = (SCB_ICSR & ICSR_PENDSTSET) != 0;
    if (requested) { /* it reached 0, and its handler has not run yet */
        left = SYST_CVR;
    }
    const uint64_t before = elapsed + (requested ? period : 0);
    core_irq_restore(primask);
    if (left == 0) { /* without a request an emulator shows the 0 a little early */
        return before + (requested ? 0 : period);
    }
    return before + (period - left);
}

uint64_t clock_ns(void) {
    const uint64_t ticks = clock_ticks();
    const uint64_t seconds = ticks / frequency;
    return seconds * 1000000000U + ticks % frequency * 1000000000U / frequency;
}

void clock_wait_ms(uint32_t ms) {
    const uint64_t start_ns = clock_ns();
    while (clock_ns() - start_ns < (uint64_t)ms * 1000000U) {
    }
}
