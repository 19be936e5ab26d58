// SPDX-License-Identifier: MIT
/* The logarithm of a long product of positive numbers, without overflow: factor by factor, and one
 * logarithm at the end. No library function: every target computes the same bits. */
#ifndef PLR_MATH_LOG_PRODUCT_H
#define PLR_MATH_LOG_PRODUCT_H

#include "pelorus/assertions.h"
#include "pelorus/config.h"

/* mantissa * 2^exponent; 1 is {1, 0} */
typedef struct plr_log_product {
    plr_real mantissa;
    int exponent;
} plr_log_product;

/* p <- p * factor. A factor outside 1e-30 to 1e30, or that is no number, leaves it as it is. */
static inline void plr_log_product_multiply(plr_log_product *p, plr_real factor) {
    const plr_real large = PLR_R(1048576);
    if (!(factor > PLR_R(1e-30)) || !(factor < PLR_R(1e30)))
        return;
    p->mantissa *= factor;
    for (; p->mantissa > large; p->exponent += 20)
        p->mantissa *= PLR_R(1) / large;
    for (; p->mantissa * large < 1; p->exponent -= 20)
        p->mantissa *= large;
}

/* ln(mantissa * 2^exponent), to 1e-7 of the mantissa's part: with s = (m - 1) / (m + 1),
 * ln m = 2 (s + s^3/3 + s^5/5 + ...), for m within [0.7, 1.42]. */
static inline plr_real plr_log_product_value(const plr_log_product *p) {
    const plr_real ln_2 = PLR_R(0.6931471805599453);
    plr_real m = p->mantissa;
    PLR_ASSERT(m > 0);
    int exponent = p->exponent;
    for (; m > PLR_R(1.4142135); exponent++)
        m *= PLR_R(0.5);
    for (; m < PLR_R(0.7071067); exponent--)
        m *= PLR_R(2);
    const plr_real s = (m - PLR_R(1)) / (m + PLR_R(1)), s2 = s * s;
    plr_real sum = PLR_R(1) / PLR_R(9);
    for (int k = 7; k > 0; k -= 2)
        sum = PLR_FMA(sum, s2, PLR_R(1) / (plr_real)k);
    return PLR_FMA((plr_real)exponent, ln_2, PLR_R(2) * s * sum);
}

#endif
