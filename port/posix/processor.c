// SPDX-License-Identifier: MIT
#include "posix/processor.h"

#include <stddef.h>

#if defined(__x86_64__)

/* What x86-64-v3 adds, as far as compilers use it in this library. PELORUS_ARCH is empty where the
 * library was built for the baseline. */
const char *processor_lacks(void) {
    if (PELORUS_ARCH[0] == '\0')
        return NULL;
    __builtin_cpu_init();
    if (!__builtin_cpu_supports("avx2"))
        return "AVX2";
    if (!__builtin_cpu_supports("fma"))
        return "FMA";
    if (!__builtin_cpu_supports("bmi"))
        return "BMI1";
    if (!__builtin_cpu_supports("bmi2"))
        return "BMI2";
    return NULL;
}

#else

const char *processor_lacks(void) {
    return NULL;
}

#endif
