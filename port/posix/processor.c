// SPDX-License-Identifier: MIT
#include "posix/processor.h"

#include <stdbool.h>
#include <stddef.h>

#if defined(__x86_64__)

#include <cpuid.h>

/* What x86-64-v3 adds, as far as compilers use it in this library, by leaf and register of CPUID. The
 * instruction is asked itself: not every compiler's runtime knows __builtin_cpu_supports. */
typedef struct feature {
    const char *name;
    unsigned leaf;
    bool ecx; /* else ebx */
    unsigned bit;
} feature;

static bool has(const feature *f) {
    unsigned eax = 0, ebx = 0, ecx = 0, edx = 0;
    return __get_cpuid_count(f->leaf, 0, &eax, &ebx, &ecx, &edx) != 0 &&
           ((f->ecx ? ecx : ebx) >> f->bit & 1u) != 0;
}

/* Does the system keep the wide registers when it changes between programs? */
static bool keeps_wide_registers(void) {
    static const feature system_has_xsave = {"OSXSAVE", 1, true, 27};
    unsigned low = 0, high = 0;
    if (!has(&system_has_xsave))
        return false;
    __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return (low & 6u) == 6u;
}

/* PELORUS_ARCH is empty where the library was built for the baseline. */
const char *processor_lacks(void) {
    static const feature features[] = {
        {"AVX2", 7, false, 5}, {"FMA", 1, true, 12}, {"BMI1", 7, false, 3}, {"BMI2", 7, false, 8}};
    if (PELORUS_ARCH[0] == '\0')
        return NULL;
    if (!keeps_wide_registers())
        return "AVX2";
    for (unsigned i = 0; i < sizeof features / sizeof features[0]; i++)
        if (!has(&features[i]))
            return features[i].name;
    return NULL;
}

#else

const char *processor_lacks(void) {
    return NULL;
}

#endif
