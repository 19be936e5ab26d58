// SPDX-License-Identifier: MIT
#include "support/flush_to_zero.h"

#if defined(__SSE2__)

#include <xmmintrin.h>

bool flush_to_zero(bool on) {
    _MM_SET_FLUSH_ZERO_MODE(on ? _MM_FLUSH_ZERO_ON : _MM_FLUSH_ZERO_OFF);
    return true;
}

#elif defined(__aarch64__)

#include <stdint.h>

bool flush_to_zero(bool on) {
    const uint64_t flag = UINT64_C(1) << 24;
    uint64_t control;
    __asm__ volatile("mrs %0, fpcr" : "=r"(control));
    control = on ? control | flag : control & ~flag;
    __asm__ volatile("msr fpcr, %0" : : "r"(control));
    return true;
}

#else

bool flush_to_zero(bool on) {
    (void)on;
    return false;
}

#endif
