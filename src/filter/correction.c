// SPDX-License-Identifier: MIT
#include "filter/correction.h"

#include <string.h>

#include "math/dense.h"
#include "math/log_product.h"
#include "math/small.h"
#include "process/velocity.h"
#include "state/blocks.h"
#include "state/covariance.h"
#include "state/model.h"
#include "state/motion.h"
#include "state/pose.h"
#include "state/rigid_fit.h"

enum { BIAS_MEASUREMENTS = 2 }; /* measurements of the biases by velocities */
enum { WIDE = 8 }; /* E's leading dimension: what follows its six columns makes two tiles of rows */

/* Measurements that are applied together, stacked: S = H P H^T + R and y = r - H dx. */
typedef struct plr_batch {
    unsigned count;
    unsigned n, ld; /* dimension of the state; between rows of V^T */
    plr_measurement measured[PLR_BLOCK_OBSERVATIONS];
    plr_real E[WIDE * PLR_BLOCK_ROWS]; /* rows x 6: H W, then U^-T H W */
} plr_batch;

/* The sums behind a plr_innovation. */
typedef struct plr_evidence {
    plr_real d2;
    plr_log_product det_root; /* of S */
    unsigned rows;
} plr_evidence;

/* Adds an applied batch, whose S = U^T U has been factorised, and y = U^-T (r - H dx): by the chain
 * rule, its innovation given the batches before, and given the motion's noise where that is kept
 * beside P. */
static void add_evidence(plr_evidence *e, const plr_workspace *w, unsigned rows) {
    for (unsigned r = 0; r < rows; r++) {
        e->d2 = PLR_FMA(w->y[r], w->y[r], e->d2);
        plr_log_product_multiply(&e->det_root, w->S[plr_upper_row(rows, r)]);
    }
    e->rows += rows;
}

/* Takes the motion's noise into account, once its Lambda = U^T U has been factorised, with its
 * estimate nu: with the information of the batches and the prior N(0, I), linearised at z,
 * d2 = |z|^2 + sum |y|^2 - |U (nu - z)|^2 and det S = det Lambda prod det S_k. */
static void add_evidence_of_motion(plr_evidence *e, const plr_noise *noise,
                                   const plr_real nu[PLR_POSE_DIM]) {
    e->d2 += plr_norm2_of_6(noise->z);
    for (unsigned r = 0; r < PLR_POSE_DIM; r++) {
        const plr_real *row = noise->Lambda + plr_upper_row(PLR_POSE_DIM, r);
        plr_real eta = 0;
        for (unsigned k = r; k < PLR_POSE_DIM; k++)
            eta = PLR_FMA(row[k - r], nu[k] - noise->z[k], eta);
        e->d2 = PLR_FMA(-eta, eta, e->d2);
        plr_log_product_multiply(&e->det_root, row[0]);
    }
}

/* S = H (P H^T) + R, packed upper, from the rows of (P H^T)^T. */
static void fill_S(const plr_filter *f, const plr_batch *batch, plr_real *S) {
    const unsigned rows = PLR_ROWS * batch->count;
    for (unsigned i = 0; i < rows; i++) {
        const plr_real *PHt = f->work.Vt + i * batch->ld;
        plr_real own[3];
        const plr_measurement *m = &batch->measured[i / PLR_ROWS];
        plr_rows_apply(&m->H, PHt, own);
        own[i % PLR_ROWS] += m->R[i % PLR_ROWS];
        for (unsigned r = i % PLR_ROWS; r < PLR_ROWS; r++)
            *S++ = own[r];
        for (unsigned b = i / PLR_ROWS + 1; b < batch->count; b++, S += PLR_ROWS)
            plr_rows_apply(&batch->measured[b].H, PHt, S);
    }
}

/* Measurement number i. After the `count` of the source come two of the biases. */
static void get_measurement(const plr_filter *f, const plr_measurement_source *sensed,
                            unsigned count, unsigned i, plr_measurement *m) {
    if (i < count) {
        sensed->measure(f, sensed->context, i, m);
        return;
    }
    memset(m, 0, sizeof *m);
    plr_velocity_bias_rows(f, i - count, &m->H, m->r);
    for (unsigned r = 0; r < PLR_ROWS; r++)
        m->R[r] = 1;
}

/* Linearises the batch's measurements; fills rows of (P H^T)^T, S and y in the workspace. */
static void stack(plr_filter *f, const plr_measurement_source *sensed, unsigned count,
                  unsigned first, plr_batch *batch) {
    plr_workspace *w = &f->work;
    for (unsigned a = 0; a < batch->count; a++) {
        plr_measurement *m = &batch->measured[a];
        get_measurement(f, sensed, count, first + a, m);
        plr_covariance_project(f, &m->H, w->Vt + PLR_ROWS * a * batch->ld, batch->ld);
        plr_real Hx[3];
        plr_rows_apply(&m->H, w->dx, Hx);
        for (unsigned i = 0; i < PLR_ROWS; i++)
            w->y[PLR_ROWS * a + i] = m->r[i] - Hx[i];
        for (unsigned k = 0; w->noise.open && k < PLR_POSE_DIM; k++) {
            plr_rows_apply(&m->H, w->noise.Wt + k * batch->ld, Hx);
            for (unsigned i = 0; i < PLR_ROWS; i++)
                batch->E[WIDE * (PLR_ROWS * a + i) + k] = Hx[i];
        }
    }
    fill_S(f, batch, w->S);
}

/* The batch's information about the motion's noise: Lambda += E^T E, eta += E^T y, with E = U^-T H
 * W and y = U^-T (r - H dx). */
static void add_noise_information(plr_noise *noise, const plr_batch *batch, const plr_real *y,
                                  unsigned rows) {
    plr_real *Lambda = noise->Lambda;
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        for (unsigned r = 0; r < rows; r++)
            noise->eta[k] = PLR_FMA(batch->E[WIDE * r + k], y[r], noise->eta[k]);
        for (unsigned l = k; l < PLR_POSE_DIM; l++, Lambda++)
            for (unsigned r = 0; r < rows; r++)
                *Lambda = PLR_FMA(batch->E[WIDE * r + k], batch->E[WIDE * r + l], *Lambda);
    }
}

/* W -= V E and dx += V y, computed as seven rows of one product, [E, -y]. */
static void update_estimate(plr_filter *f, plr_batch *batch, unsigned rows) {
    plr_workspace *w = &f->work;
    plr_real *Wt = w->noise.Wt, *beyond = w->diagonal;
    const size_t ld = batch->ld;
    for (unsigned r = 0; r < rows; r++) {
        batch->E[WIDE * r + 6] = -w->y[r];
        batch->E[WIDE * r + 7] = 0;
    }
    plr_real *const first[4] = {Wt, Wt + ld, Wt + 2 * ld, Wt + 3 * ld};
    plr_real *const last[4] = {Wt + 4 * ld, Wt + 5 * ld, w->dx, beyond};
    plr_subtract_four_rows(batch->ld, rows, batch->E, WIDE, w->Vt, ld, first);
    plr_subtract_four_rows(batch->ld, rows, batch->E + 4, WIDE, w->Vt, ld, last);
}

/* With S = U^T U: V^T = U^-T (P H^T)^T, P -= V V^T, dx += V U^-T y. False, and nothing changed but
 * the workspace, if S is not positive (*factorised = false) or a variance would not stay
 * positive. */
static bool apply_batch(plr_filter *f, plr_batch *batch, bool *factorised) {
    plr_workspace *w = &f->work;
    const unsigned rows = PLR_ROWS * batch->count;
    *factorised = plr_cholesky_upper(rows, w->S);
    if (!*factorised)
        return false;
    plr_solve_upper_transposed(rows, batch->ld, w->S, w->Vt, batch->ld);
    plr_solve_upper_transposed(rows, 1, w->S, w->y, 1);
    if (!plr_covariance_subtract(f, rows))
        return false;
    if (!w->noise.open) {
        plr_combine_rows(batch->n, rows, w->y, w->Vt, batch->ld, w->dx);
        return true;
    }
    plr_solve_upper_transposed(rows, PLR_POSE_DIM, w->S, batch->E, WIDE);
    add_noise_information(&w->noise, batch, w->y, rows);
    update_estimate(f, batch, rows);
    return true;
}

/* True if the correction is finite and small enough for a retraction. */
static bool is_applicable(const plr_filter *f, unsigned n) {
    static const plr_real max_way2 = 1e6;
    const plr_real *dx = f->work.dx;
    for (unsigned i = 0; i < n; i++)
        if (!plr_is_finite(dx[i]))
            return false;
    return plr_dot3(dx, dx) < max_way2 && plr_dot3(dx + 3, dx + 3) < PLR_MAX_CORRECTION_TURN2;
}

plr_correction plr_correct(plr_filter *f, const plr_measurement_source *sensed, unsigned count) {
    plr_correction result = {0};
    const unsigned n = plr_covariance_dim(f);
    if (!f->work.noise.open) { /* no motion has been applied */
        memset(f->work.dx, 0, n * sizeof *f->work.dx);
        memset(f->work.noise.motion_variance, 0, sizeof f->work.noise.motion_variance);
    }
    plr_evidence evidence = {0, plr_log_product_one(), 0};
    const unsigned all = count + (plr_velocity_informs_bias(f) ? BIAS_MEASUREMENTS : 0);
    unsigned batches = (all + PLR_BLOCK_OBSERVATIONS - 1) / PLR_BLOCK_OBSERVATIONS, at = 0;
    for (; batches > 0 && !f->diverged; batches--) {
        plr_batch batch; /* not initialised: that would cost as much as a row of S */
        bool factorised;
        batch.n = n;
        batch.ld = plr_covariance_ld(f);
        batch.count =
            (all - at + batches - 1) / batches; /* of like size: the cost grows with its square */
        stack(f, sensed, count, at, &batch);
        if (apply_batch(f, &batch, &factorised)) {
            result.applied += at >= count ? 0 : at + batch.count > count ? count - at : batch.count;
            add_evidence(&evidence, &f->work, PLR_ROWS * batch.count);
        } else if (!factorised)
            result.failed_batches++;
        else
            plr_filter_diverge(f);
        at += batch.count;
    }
    result.moved = f->work.noise.open;
    memcpy(result.Lambda, f->work.noise.Lambda, sizeof result.Lambda);
    plr_covariance_close_noise(f, result.nu);
    if (result.moved)
        add_evidence_of_motion(&evidence, &f->work.noise, result.nu);
    result.innovation.d2 = evidence.d2;
    result.innovation.log_det = 2 * plr_log_product_value(&evidence.det_root);
    result.innovation.rows = evidence.rows;
    if (result.applied == 0 && !result.moved && all == count)
        return result;
    if (!is_applicable(f, n)) {
        plr_filter_diverge(f);
        return result;
    }
    if (plr_has_block(f, PLR_BLOCK_BIAS))
        for (unsigned i = 0; i < PLR_BIAS_DIM; i++)
            f->bias[i] += f->work.dx[plr_row_of(f, PLR_BLOCK_BIAS) + i];
    if (plr_has_block(f, PLR_BLOCK_VELOCITY))
        for (unsigned i = 0; i < PLR_VELOCITY_DIM; i++)
            f->inertial.velocity[i] += f->work.dx[plr_row_of(f, PLR_BLOCK_VELOCITY) + i];
    plr_velocity_forget_bias(f);
    result.cut = plr_model_of(f)->retract(f, f->work.dx);
    plr_pose_correct(f, f->work.dx);
    plr_covariance_make_up_for_rounding(f);
    if (!plr_covariance_is_positive(f))
        plr_filter_diverge(f);
    return result;
}
