// SPDX-License-Identifier: MIT
#include <stdint.h>
#include <string.h>

#include "pelorus/config.h"

/* Without the instruction compilers call the C library's fmaf, which this library does not link: said
 * here, once, and not by the linker. */
#if PLR_REAL == 32 && !PLR_PORTABLE && !defined(__FP_FAST_FMAF) && !defined(__FMA__) &&            \
    !PLR_WASM_FMA && !defined(__ARM_FEATURE_FMA) && !defined(__aarch64__) && !defined(__riscv_f)
#error                                                                                             \
    "Pelorus in float32 needs fused multiply-add: compile for a processor that has it (-march=x86-64-v3, -mcpu=cortex-m4 -mfloat-abi=hard ...), or with -DPLR_PORTABLE=1, which is slower and gives the same bits."
#endif

/*
 * The product of two float32 is exact in double, but adding c rounds to 53 bits, and the cast would
 * round a second time. Rounding the sum to odd instead (Boldo and Melquiond, 2008) keeps what the
 * second rounding needs: if the sum was inexact and its last bit is even, step to the neighbour on
 * the side of the error.
 */
float plr_fmaf_exact(float a, float b, float c) {
    const double product = (double)a * (double)b;
    const double addend = (double)c;
    double sum = product + addend;

    /* Two-sum (Knuth): sum + error is exact. With infinities error is NaN, and is not used. */
    const double part = sum - product;
    const double error = (product - (sum - part)) + (addend - part);
    if (error < 0 || error > 0) {
        uint64_t bits;
        memcpy(&bits, &sum, sizeof bits);
        if ((bits & 1U) == 0) {
            const int away_from_zero = (error > 0) == (sum > 0);
            bits = away_from_zero ? bits + 1 : bits - 1;
            memcpy(&sum, &bits, sizeof sum);
        }
    }
    return (float)sum;
}
