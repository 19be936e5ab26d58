// SPDX-License-Identifier: MIT
/* An exact fused multiply-add for processors that lack one (PLR_PORTABLE). */
#ifndef PLR_MATH_FMA_H
#define PLR_MATH_FMA_H

/* round(a b + c) to float32, once. The same bits as the processor's instruction, for every finite
 * input and for infinities; a NaN results in a NaN. Needs nothing but IEEE double arithmetic. */
float plr_fmaf_exact(float a, float b, float c);

#endif
