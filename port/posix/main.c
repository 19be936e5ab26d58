// SPDX-License-Identifier: MIT
/* Checks that this processor has the instructions that the library was built for. Everything in
 * this folder is built for any processor of the family, so that the check can run before the
 * library. */
#include <stdio.h>

#include "posix/replay.h"
#include "posix/system.h"

#if defined(__x86_64__)

/* The name of a missing feature, or NULL: what x86-64-v3 adds, as far as compilers use it in this
 * library. PELORUS_ARCH is empty where the library was built for the baseline. */
static const char *lacks(void) {
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

static const char *lacks(void) {
    return NULL;
}

#endif

int main(int argc, char **argv) {
    const char *missing = lacks();
    if (missing != NULL) {
        fprintf(stderr,
                PELORUS_NAME ": this processor lacks %s, and the program was built for "
                             "-march=" PELORUS_ARCH ". Build it with -DPLR_PORTABLE=ON: slower, "
                             "the same bits.\n",
                missing);
        return REPLAY_EXIT_CPU;
    }
    system_begin();
    return replay_main(argc, argv);
}
