// SPDX-License-Identifier: MIT
#include "filter/correction.h"

#include <string.h>

#include "filter/gate.h"
#include "math/dense.h"
#include "math/small.h"
#include "state/covariance.h"
#include "state/model.h"
#include "state/motion.h"
#include "state/pose.h"
#include "state/rigid_fit.h"

enum { WIDE = 8 }; /* E's leading dimension: what follows its six columns makes two tiles of rows */

/* One block of observations, stacked: S = H P H^T + R and y = r - H dx. */
typedef struct plr_block {
    unsigned count;
    unsigned n, ld;                          /* dimension of the state; between rows of V^T */
    unsigned row_of[PLR_BLOCK_OBSERVATIONS]; /* first row of each landmark in the state */
    plr_linearisation lin[PLR_BLOCK_OBSERVATIONS];
    plr_real E[WIDE * PLR_BLOCK_ROWS]; /* rows x 6: H W, then U^-T H W */
} plr_block;

/* out = H_a x, three rows: x is a vector over the state. */
static inline void apply(const plr_block *block, unsigned a, const plr_real *x, plr_real out[3]) {
    const plr_linearisation *lin = &block->lin[a];
    plr_mat3_vec(out, lin->H_landmark, x + block->row_of[a]);
    if (!lin->uses_pose)
        return;
    for (unsigned r = 0; r < PLR_ROWS; r++)
        for (unsigned c = 0; c < PLR_POSE_DIM; c++)
            out[r] = PLR_FMA(lin->H_pose[6 * r + c], x[c], out[r]);
}

/* S = H (P H^T) + R, packed upper, from the rows of (P H^T)^T. */
static void fill_S(const plr_filter *f, const plr_block *block, plr_real *S) {
    const unsigned rows = PLR_ROWS * block->count;
    for (unsigned i = 0; i < rows; i++) {
        const plr_real *PHt = f->work.Vt + i * block->ld;
        plr_real own[3];
        apply(block, i / PLR_ROWS, PHt, own);
        own[i % PLR_ROWS] += plr_gate_noise(f, i % PLR_ROWS);
        for (unsigned r = i % PLR_ROWS; r < PLR_ROWS; r++)
            *S++ = own[r];
        for (unsigned b = i / PLR_ROWS + 1; b < block->count; b++, S += PLR_ROWS)
            apply(block, b, PHt, S);
    }
}

/* Linearises the block's observations; fills rows of (P H^T)^T, S and y in the workspace. */
static void stack_block(plr_filter *f, const plr_observation *observations, const uint16_t *used,
                        plr_block *block) {
    plr_workspace *w = &f->work;
    for (unsigned a = 0; a < block->count; a++) {
        const unsigned slot = w->slot_of[used[a]];
        plr_linearisation *lin = &block->lin[a];
        if (!plr_model_of(f)->linearise(f, &f->slots[slot], lin))
            memset(lin, 0,
                   sizeof *lin); /* the motion has brought it beside the camera: it says nothing */
        block->row_of[a] = plr_covariance_row(f, slot);
        plr_covariance_project(f, slot, lin, w->Vt + PLR_ROWS * a * block->ld, block->ld);

        plr_real r[3], Hx[3];
        plr_gate_innovation(r, &observations[w->order[used[a]]], lin);
        apply(block, a, w->dx, Hx);
        for (unsigned i = 0; i < PLR_ROWS; i++)
            w->y[PLR_ROWS * a + i] = r[i] - Hx[i];
        for (unsigned k = 0; w->noise.open && k < 6; k++) {
            apply(block, a, w->noise.Wt + k * block->ld, Hx);
            for (unsigned i = 0; i < PLR_ROWS; i++)
                block->E[WIDE * (PLR_ROWS * a + i) + k] = Hx[i];
        }
    }
    fill_S(f, block, w->S);
}

/* What the block tells of the motion's noise, with E = U^-T H W and y = U^-T (r - H dx):
 * Lambda += E^T E, eta += E^T y. */
static void inform_noise(plr_noise *noise, const plr_block *block, const plr_real *y,
                         unsigned rows) {
    plr_real *Lambda = noise->Lambda;
    for (unsigned k = 0; k < 6; k++) {
        for (unsigned r = 0; r < rows; r++)
            noise->eta[k] = PLR_FMA(block->E[WIDE * r + k], y[r], noise->eta[k]);
        for (unsigned l = k; l < 6; l++, Lambda++)
            for (unsigned r = 0; r < rows; r++)
                *Lambda = PLR_FMA(block->E[WIDE * r + k], block->E[WIDE * r + l], *Lambda);
    }
}

/* W -= V E and dx += V y, as seven rows of one product: -y stands beside E. */
static void move_state(plr_filter *f, plr_block *block, unsigned rows) {
    plr_workspace *w = &f->work;
    plr_real *Wt = w->noise.Wt, *beyond = w->diagonal;
    const size_t ld = block->ld;
    for (unsigned r = 0; r < rows; r++) {
        block->E[WIDE * r + 6] = -w->y[r];
        block->E[WIDE * r + 7] = 0;
    }
    plr_real *const first[4] = {Wt, Wt + ld, Wt + 2 * ld, Wt + 3 * ld};
    plr_real *const last[4] = {Wt + 4 * ld, Wt + 5 * ld, w->dx, beyond};
    plr_subtract_four_rows(block->ld, rows, block->E, WIDE, w->Vt, ld, first);
    plr_subtract_four_rows(block->ld, rows, block->E + 4, WIDE, w->Vt, ld, last);
}

/* With S = U^T U: V^T = U^-T (P H^T)^T, P -= V V^T, dx += V U^-T y. False, and nothing changed but the
 * workspace, if S is not positive (*factorised = false) or a variance would be lost. */
static bool apply_block(plr_filter *f, plr_block *block, bool *factorised) {
    plr_workspace *w = &f->work;
    const unsigned rows = PLR_ROWS * block->count;
    *factorised = plr_cholesky_upper(rows, w->S);
    if (!*factorised)
        return false;
    plr_solve_upper_transposed(rows, block->ld, w->S, w->Vt, block->ld);
    plr_solve_upper_transposed(rows, 1, w->S, w->y, 1);
    if (!plr_covariance_subtract(f, rows))
        return false;
    if (!w->noise.open) {
        plr_combine_rows(block->n, rows, w->y, w->Vt, block->ld, w->dx);
        return true;
    }
    plr_solve_upper_transposed(rows, 6, w->S, block->E, WIDE);
    inform_noise(&w->noise, block, w->y, rows);
    move_state(f, block, rows);
    return true;
}

/* Is the correction one that a retraction can follow? */
static bool is_sane(const plr_filter *f, unsigned n) {
    static const plr_real max_way2 = 1e6;
    const plr_real *dx = f->work.dx;
    for (unsigned i = 0; i < n; i++)
        if (!plr_is_finite(dx[i]))
            return false;
    return plr_dot3(dx, dx) < max_way2 && plr_dot3(dx + 3, dx + 3) < PLR_MAX_CORRECTION_TURN2;
}

plr_correction plr_correct(plr_filter *f, const plr_observation *observations, unsigned count) {
    plr_correction result = {0};
    const unsigned n = plr_covariance_dim(f);
    if (!f->work.noise.open) { /* no motion has been applied */
        memset(f->work.dx, 0, n * sizeof *f->work.dx);
        memset(f->work.noise.spread, 0, sizeof f->work.noise.spread);
    }
    unsigned blocks = (count + PLR_BLOCK_OBSERVATIONS - 1) / PLR_BLOCK_OBSERVATIONS, at = 0;
    for (; blocks > 0 && !f->diverged; blocks--) {
        plr_block block; /* not initialised: that would cost as much as a row of S */
        bool factorised;
        block.n = n;
        block.ld = plr_covariance_ld(f);
        block.count =
            (count - at + blocks - 1) / blocks; /* alike: the cost grows with the square */
        stack_block(f, observations, f->work.used + at, &block);
        if (apply_block(f, &block, &factorised))
            result.applied += block.count;
        else if (!factorised)
            result.failed_blocks++;
        else
            plr_filter_diverge(f);
        at += block.count;
    }
    result.moved = f->work.noise.open;
    memcpy(result.Lambda, f->work.noise.Lambda, sizeof result.Lambda);
    plr_covariance_close_noise(f, result.nu);
    if (result.applied == 0 && !result.moved)
        return result;
    if (!is_sane(f, n)) {
        plr_filter_diverge(f);
        return result;
    }
    if (f->config.bias)
        for (unsigned i = 0; i < PLR_BIAS_DIM; i++)
            f->bias[i] += f->work.dx[PLR_POSE_DIM + i];
    result.cut = plr_model_of(f)->retract(f, f->work.dx);
    plr_pose_correct(f, f->work.dx);
    plr_covariance_make_up_for_rounding(f);
    if (!plr_covariance_is_positive(f))
        plr_filter_diverge(f);
    return result;
}
