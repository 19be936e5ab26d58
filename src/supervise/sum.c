// SPDX-License-Identifier: MIT
#include "supervise/sum.h"

#include <string.h>

#include "math/dense.h"
#include "math/leaky.h"
#include "math/small.h"

void plr_sum_add(plr_sum *sum, plr_real keep, const plr_real x[PLR_POSE_DIM],
                 const plr_real C[PLR_POSE_TRIANGLE]) {
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        sum->sum[k] = plr_leaky_sum(sum->sum[k], keep, x[k]);
    for (unsigned k = 0; k < PLR_POSE_TRIANGLE; k++)
        sum->variance[k] = plr_leaky_sum(sum->variance[k], keep * keep, C[k]);
}

/* U^T U = D V D + floor I; D may be NULL. */
static bool factorise(const plr_real V[PLR_POSE_TRIANGLE], const plr_real *D, plr_real floor,
                      plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN]) {
    for (unsigned k = 0, at = 0; k < PLR_POSE_DIM; k++)
        for (unsigned l = k; l < PLR_POSE_DIM; l++, at++)
            U[at] = (D ? V[at] * D[k] * D[l] : V[at]) + (k == l ? floor : PLR_R(0));
    return plr_cholesky_upper(PLR_POSE_DIM, U);
}

plr_real plr_sum_statistic(const plr_sum *sum, const plr_real *usual, plr_real floor) {
    plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN] = {0}, s[PLR_POSE_DIM], D[PLR_POSE_DIM];
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        D[k] = usual ? PLR_SQRT(usual[k]) : PLR_R(1);
        s[k] = sum->sum[k];
    }
    if (!factorise(sum->variance, D, floor, U))
        return 0;
    plr_solve_upper_transposed(PLR_POSE_DIM, 1, U, s, 1);
    return plr_norm2_of_6(s);
}

void plr_sum_by_pictures(const plr_real s[PLR_POSE_DIM], const plr_real V[PLR_POSE_TRIANGLE],
                         plr_real floor, plr_real n[PLR_POSE_DIM]) {
    plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN] = {0};
    memcpy(n, s, PLR_POSE_DIM * sizeof *s);
    if (!factorise(V, NULL, floor, U))
        return;
    plr_solve_upper_transposed(PLR_POSE_DIM, 1, U, n, 1);
    plr_solve_upper(PLR_POSE_DIM, U, n);
}
