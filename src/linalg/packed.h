// SPDX-License-Identifier: MIT
/*
 * The packed lower triangle of a symmetric matrix, row by row: (0,0) (1,0) (1,1) (2,0) ...
 * The one kernel in which an update spends its time stands here, with its plain twin.
 */
#ifndef PLR_LINALG_PACKED_H
#define PLR_LINALG_PACKED_H

#include <stddef.h>

#include "pelorus/config.h"

/* Where row i begins. */
static inline size_t plr_packed_row(size_t i) {
    return i * (i + 1) / 2;
}

/* Where (i, j) stands, either way round. */
static inline size_t plr_packed_at(size_t i, size_t j) {
    return i >= j ? plr_packed_row(i) + j : plr_packed_row(j) + i;
}

/* P -= U W^T, lower triangle: P is n x n packed, U^T and W^T are depth x n with leading dimension
 * ld. U W^T must be symmetric. The memory behind all three must be readable for PLR_KERNEL_MARGIN
 * elements. */
void plr_packed_subtract(unsigned n, unsigned depth, const plr_real *Ut, const plr_real *Wt,
                         size_t ld, plr_real *P);

/* d[i] = P_ii - sum_k Ut[k][i]^2 for i = 0 .. n-1, in the same steps: what plr_packed_subtract with
 * W = U would leave on the diagonal. d holds n numbers. Reads as far behind U^T as
 * plr_packed_subtract. */
void plr_packed_subtracted_diagonal(unsigned n, unsigned depth, const plr_real *Ut, size_t ld,
                                    const plr_real *P, plr_real *d);

/* The plain twin: the same bits, element by element. */
void plr_packed_subtract_plain(unsigned n, unsigned depth, const plr_real *Ut, const plr_real *Wt,
                               size_t ld, plr_real *P);

#endif
