// SPDX-License-Identifier: MIT
/*
 * The packed lower triangle of a symmetric matrix, row by row: (0,0) (1,0) (1,1) (2,0) ...
 * plr_packed_subtract is the kernel that takes most of an update's time; a plain version of it is
 * the reference in tests.
 */
#ifndef PLR_MATH_PACKED_H
#define PLR_MATH_PACKED_H

#include <stddef.h>

#include "pelorus/config.h"

/* Index of the first element of row i. */
static inline size_t plr_packed_row(size_t i) {
    return i * (i + 1) / 2;
}

/* Index of element (i, j), which is also (j, i). */
static inline size_t plr_packed_at(size_t i, size_t j) {
    return i >= j ? plr_packed_row(i) + j : plr_packed_row(j) + i;
}

/* P -= U W^T, lower triangle: P is n x n packed, U^T and W^T depth x n with leading dimension ld, U
 * W^T symmetric. PLR_KERNEL_MARGIN elements after the end of each must be readable. */
void plr_packed_subtract(unsigned n, unsigned depth, const plr_real *Ut, const plr_real *Wt,
                         size_t ld, plr_real *P);

/* d[i] = P_ii - sum_k Ut[k][i]^2 of the next rows i = first .. n-1, at most PLR_TILE_COLUMNS of
 * them, whose number is returned: the diagonal, to the bit, that plr_packed_subtract with W = U
 * leaves. `first` is a multiple of PLR_TILE_COLUMNS. Reads as far beyond the end of U^T as that. */
unsigned plr_packed_subtracted_diagonal(unsigned first, unsigned n, unsigned depth,
                                        const plr_real *Ut, size_t ld, const plr_real *P,
                                        plr_real d[PLR_TILE_COLUMNS]);

/* plr_packed_subtract without tiles, element by element: slower, the same bits. */
void plr_packed_subtract_plain(unsigned n, unsigned depth, const plr_real *Ut, const plr_real *Wt,
                               size_t ld, plr_real *P);

#endif
