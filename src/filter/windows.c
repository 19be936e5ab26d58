// SPDX-License-Identifier: MIT
#include "filter/windows.h"

#include <string.h>

#include "math/dense.h"
#include "math/small.h"
#include "state/motion.h"

/* What a window keeps of its sums from frame to frame. */
static const plr_real decay[PLR_CONSISTENCY_WINDOWS] = {PLR_R(0.6), PLR_R(0.9), PLR_R(0.985)};

void plr_windows_clear(plr_filter *f) {
    memset(f->consistency.windows, 0, sizeof f->consistency.windows);
    f->consistency.fast = 0;
}

void plr_windows_add(plr_filter *f, const plr_real nu[PLR_POSE_DIM],
                     const plr_real V[PLR_POSE_TRIANGLE], bool slow) {
    for (unsigned i = 0; i < (slow ? PLR_CONSISTENCY_WINDOWS : PLR_SLOW_WINDOW); i++) {
        plr_consistency_window *w = &f->consistency.windows[i];
        for (unsigned k = 0; k < PLR_POSE_DIM; k++)
            w->sum[k] = PLR_FMA(decay[i], w->sum[k], nu[k]);
        for (unsigned k = 0; k < PLR_POSE_TRIANGLE; k++)
            w->variance[k] = PLR_FMA(decay[i] * decay[i], w->variance[k], V[k]);
    }
}

/* ---------------------------------------------------------------- biases that are kept */

/* C = A X A, A and C packed upper triangles, X symmetric */
static void multiply_both_sides(const plr_real A[PLR_POSE_TRIANGLE],
                                const plr_real X[PLR_POSE_SQUARE], plr_real C[PLR_POSE_TRIANGLE]) {
    plr_real full[PLR_POSE_SQUARE], XA[PLR_POSE_SQUARE], AXA[PLR_POSE_SQUARE];
    plr_upper6_unpack(full, A);
    plr_mat6_mul(XA, X, full);
    plr_mat6_mul(AXA, full, XA);
    for (unsigned k = 0, at = 0; k < PLR_POSE_DIM; k++)
        for (unsigned l = k; l < PLR_POSE_DIM; l++, at++)
            C[at] = AXA[PLR_POSE_DIM * k + l];
}

void plr_windows_keep_bias(const plr_filter *f, const plr_real *X,
                           const plr_real V[PLR_POSE_TRIANGLE], plr_kept_bias *kept) {
    memset(kept, 0, sizeof *kept);
    if (!X)
        return;
    kept->frames = f->consistency.doubted_frames;
    multiply_both_sides(V, X, kept->of_nu);
}

static plr_real power(plr_real x, unsigned n) {
    plr_real product = 1;
    for (; n > 0; n /= 2, x *= x)
        product = n % 2 ? product * x : product;
    return product;
}

/* A sum of n numbers of variance 1, each with the weight `keep` beside the next, has the variance ((1 -
 * keep^n) / (1 - keep))^2 if they are the same, and (1 - keep^2n) / (1 - keep^2) if they are independent.
 * Returns the difference: the windows contain the second. */
static plr_real excess_of_same(plr_real keep, unsigned n) {
    const plr_real faded = power(keep, n), sum = (PLR_R(1) - faded) / (PLR_R(1) - keep);
    return sum * sum - (PLR_R(1) - faded * faded) / (PLR_R(1) - keep * keep);
}

/* ---------------------------------------------------------------- the statistics */

/* The three numbers of the translation come first, so the last three of U^-T s are those of the turns
 * about whatever translation fits best. */
static plr_statistic statistic(const plr_filter *f, unsigned window, plr_real floor,
                               const plr_kept_bias *kept) {
    const plr_consistency_window *w = &f->consistency.windows[window];
    const plr_statistic none = {0, 0};
    plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN] = {0}, s[PLR_POSE_DIM];
    memcpy(U, w->variance, sizeof w->variance);
    memcpy(s, w->sum, sizeof s);
    if (kept && kept->frames > 0) {
        const plr_real excess = excess_of_same(decay[window], kept->frames);
        for (unsigned k = 0; k < PLR_POSE_TRIANGLE; k++)
            U[k] = PLR_FMA(excess, kept->of_nu[k], U[k]);
    }
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        U[plr_upper_row(PLR_POSE_DIM, k)] += floor;
    if (!plr_cholesky_upper(PLR_POSE_DIM, U))
        return none;
    plr_solve_upper_transposed(PLR_POSE_DIM, 1, U, s, 1);
    const plr_real turns = plr_dot3(s + 3, s + 3);
    return (plr_statistic){plr_dot3(s, s) + turns, turns};
}

plr_statistic plr_windows_fast(const plr_filter *f, plr_real floor, const plr_kept_bias *kept) {
    const plr_statistic a = statistic(f, PLR_FASTEST_WINDOW, floor, kept);
    const plr_statistic b = statistic(f, PLR_FAST_WINDOW, floor, kept);
    return (plr_statistic){a.all > b.all ? a.all : b.all, a.turns > b.turns ? a.turns : b.turns};
}

plr_statistic plr_windows_slow(const plr_filter *f, plr_real floor, const plr_kept_bias *kept) {
    return statistic(f, PLR_SLOW_WINDOW, floor, kept);
}

void plr_by_pictures_alone(const plr_real nu[PLR_POSE_DIM], const plr_real V[PLR_POSE_TRIANGLE],
                           plr_real floor, plr_real n[PLR_POSE_DIM]) {
    plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN] = {0};
    memcpy(U, V, PLR_POSE_TRIANGLE * sizeof *V);
    memcpy(n, nu, PLR_POSE_DIM * sizeof *nu);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        U[plr_upper_row(PLR_POSE_DIM, k)] += floor;
    if (!plr_cholesky_upper(PLR_POSE_DIM, U))
        return;
    plr_solve_upper_transposed(PLR_POSE_DIM, 1, U, n, 1);
    plr_solve_upper(PLR_POSE_DIM, U, n);
}

void plr_windows_mean(const plr_filter *f, plr_real floor, plr_real n[PLR_POSE_DIM]) {
    const plr_consistency_window *w = &f->consistency.windows[PLR_FASTEST_WINDOW];
    plr_by_pictures_alone(w->sum, w->variance, floor, n);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) /* from the sum over frames to one frame's mean */
        n[k] /= PLR_R(1) + decay[PLR_FASTEST_WINDOW];
}
