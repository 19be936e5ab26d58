// SPDX-License-Identifier: MIT
/* The watchdog of Arm's Cortex-M System Design Kit (DDI 0479, section 4.5). */
#include "cmsdk_watchdog.h"

#include "../core.h"

enum {
    LOAD = 0x00,
    CONTROL = 0x08,
    INTCLR = 0x0C,
    LOCK = 0xC00,

    CONTROL_COUNT = 1 << 0, /* counts, and raises its interrupt at zero */
    CONTROL_RESET = 1 << 1  /* resets at the second zero in a row */
};

#define UNLOCK_KEY 0x1ACCE551U

void cmsdk_watchdog_start(uintptr_t address, uint32_t ticks) {
    CORE_REGISTER(address + LOCK) = UNLOCK_KEY;
    CORE_REGISTER(address + LOAD) = ticks;
    CORE_REGISTER(address + CONTROL) = CONTROL_COUNT | CONTROL_RESET;
    CORE_REGISTER(address + LOCK) = 0;
}

void cmsdk_watchdog_feed(uintptr_t address) {
    CORE_REGISTER(address + LOCK) = UNLOCK_KEY;
    CORE_REGISTER(address + INTCLR) = 1; /* also loads the counter anew */
    CORE_REGISTER(address + LOCK) = 0;
}
