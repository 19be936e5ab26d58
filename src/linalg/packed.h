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

/* Elements behind the last of U^T and W^T that plr_packed_subtract may read (and ignore). */
enum { PLR_PACKED_OVERREAD = PLR_TILE_COLUMNS + 4 };

/* P -= U W^T, lower triangle: P is n x n packed, U^T and W^T are depth x n with leading dimension
 * ld. U W^T must be symmetric. The memory behind both must be readable for PLR_PACKED_OVERREAD
 * elements. */
void plr_packed_subtract(unsigned n, unsigned depth, const plr_real *Ut, const plr_real *Wt,
                         size_t ld, plr_real *P);

/* The plain twin: the same bits, element by element. */
void plr_packed_subtract_plain(unsigned n, unsigned depth, const plr_real *Ut, const plr_real *Wt,
                               size_t ld, plr_real *P);

#endif
