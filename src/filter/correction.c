// SPDX-License-Identifier: MIT
#include "filter/correction.h"

#include <string.h>

#include "filter/filter_internal.h"
#include "math/dense.h"
#include "math/log_product.h"
#include "math/small.h"
#include "pelorus/assertions.h"
#include "process/velocity.h"
#include "sensor/kept.h"
#include "sensor/stereo.h"
#include "state/blocks.h"
#include "state/calibration.h"
#include "state/covariance.h"
#include "state/model.h"
#include "state/motion.h"
#include "state/pose.h"
#include "state/sightings.h"

enum { BIAS_MEASUREMENTS = 2 }; /* measurements of the biases by velocities */
/* The columns of a batch's E. They make whole tiles of rows of the product, and at most one more, or this
 * does not compile. */
enum { OF_W, OF_DX = PLR_POSE_DIM, OF_S, WIDE = OF_S + PLR_CALIBRATIONS, TILE = 4 };
enum { WHOLE_TILES = 1 / (WIDE % TILE <= 1) };
enum {
    BESIDE_Y = PLR_POSE_DIM - 1
}; /* the sensitivity's columns in the block of six that y begins */

/* All measurements of a correction, in their order: rows of a frame, the given ones, and two of the biases. */
typedef struct plr_sensed {
    const plr_sightings *frame;
    unsigned next;        /* row of the frame */
    unsigned seen, count; /* rows that are used; with the given ones */
    const plr_measurement *given;
} plr_sensed;

/* Measurements that are applied together, stacked: S = H P H^T + R and E = [H W, -y, the same of the
 * sensitivity's columns] with y = r - H dx, then S = U^T U and U^-T E. V^T is in the workspace. */
typedef struct plr_batch {
    unsigned rows, empty; /* of which so many measure nothing */
    unsigned ld;          /* between rows of V^T */
    plr_real S[PLR_BLOCK_ROWS * (PLR_BLOCK_ROWS + 1) / 2 +
               PLR_KERNEL_MARGIN]; /* packed upper triangle */
    plr_real E[WIDE * PLR_BLOCK_ROWS];
} plr_batch;

/* The sums behind a plr_innovation. */
typedef struct plr_likelihood {
    plr_real d2;
    plr_log_product det_root; /* of S */
    unsigned rows;
} plr_likelihood;

/* Adds an applied batch, whose S = U^T U has been factorised, and y = U^-T (r - H dx): by the chain
 * rule, its innovation given the batches before, and given the motion's noise where that is kept
 * beside P. */
static void add_likelihood(plr_likelihood *e, const plr_batch *batch) {
    for (unsigned r = 0; r < batch->rows; r++) {
        const plr_real y = batch->E[WIDE * r + OF_DX];
        e->d2 = PLR_FMA(y, y, e->d2);
        plr_log_product_multiply(&e->det_root, batch->S[plr_upper_row(batch->rows, r)]);
    }
    e->rows += batch->rows - batch->empty;
}

/* Takes the motion's noise into account, once its Lambda = U^T U has been factorised, with its
 * estimate nu: with the information of the batches and the prior N(0, I), linearised at z,
 * d2 = |z|^2 + sum |y|^2 - |U (nu - z)|^2 and det S = det Lambda prod det S_k. */
static void add_likelihood_of_motion(plr_likelihood *e, const plr_noise *noise,
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

/* The next row that is used. */
static const plr_sighting *next_row(plr_sensed *sensed) {
    while (!sensed->frame->at[sensed->next].used)
        sensed->next++;
    PLR_ASSERT(sensed->next < sensed->frame->count);
    return &sensed->frame->at[sensed->next++];
}

/* Measurement number i; of an observation its row. */
static void get_measurement(const plr_filter *f, const plr_sensed *sensed, unsigned i,
                            const plr_sighting *row, plr_measurement *m) {
    if (row) {
        plr_measurement_recall(&f->belief, &f->work, row->slot, m);
    } else if (i < sensed->count) {
        *m = sensed->given[i - sensed->seen];
    } else {
        memset(m, 0, sizeof *m);
        plr_velocity_bias_rows(&f->belief, &f->source, i - sensed->count, &m->H, m->r);
        for (unsigned r = 0; r < PLR_ROWS; r++)
            m->R[r] = 1;
    }
}

/* Columns of a batch's E, in whole tiles, those behind the sensitivity's being zero; but a last one that
 * would be alone in its tile stays so. */
static unsigned whole_tiles(const plr_filter *f) {
    const plr_error_columns *errors = &f->camera.errors;
    const unsigned least = plr_calibration_estimated(errors) > 0 ? BESIDE_Y : 0;
    const unsigned columns = (unsigned)OF_S + (errors->count > least ? errors->count : least);
    return columns % TILE == 1 ? columns : (columns + TILE - 1) / TILE * TILE;
}

/* A column of the sensitivity (state/sensitivity.h) is corrected as dx is, with -H_s in the place of
 * the residual: by how much the error of the calibration changes what is predicted. */
static void stack_sensitivity(const plr_filter *f, const plr_sighting *row,
                              const plr_measurement *m, plr_batch *batch, unsigned first) {
    plr_real H_s[PLR_CALIBRATIONS][PLR_ROWS], column[PLR_ROWS];
    memset(H_s, 0, f->camera.errors.count * sizeof *H_s);
    if (row && f->camera.errors.count > 0)
        plr_stereo_by_calibration(&f->belief, &f->camera, row->slot, row->seen, H_s);
    for (unsigned k = 0; !row && m->of_wheel && k < f->camera.errors.count; k++)
        if (f->camera.errors.kind[k] >= PLR_WHEEL_SCALE)
            memcpy(H_s[k], m->by_wheel.error[f->camera.errors.kind[k] - PLR_WHEEL_SCALE],
                   sizeof H_s[k]);
    for (unsigned k = 0; OF_S + k < whole_tiles(f); k++) {
        const bool has_column = k < f->camera.errors.count;
        if (has_column)
            plr_rows_apply(&m->H, f->belief.S[k], column);
        for (unsigned r = 0; r < PLR_ROWS; r++)
            batch->E[WIDE * (first + r) + OF_S + k] = has_column ? H_s[k][r] + column[r] : PLR_R(0);
    }
}

/* Adds a measurement to the batch, from row `first` on: its rows of (P H^T)^T and E, and its
 * columns of S, H (P H^T) + R. */
static void stack(plr_filter *f, const plr_measurement *m, unsigned first, plr_batch *batch) {
    plr_workspace *w = &f->work;
    PLR_ASSERT(first + PLR_ROWS <= batch->rows);
    plr_real column[PLR_ROWS];
    plr_covariance_project(&f->belief, &m->H, w->Vt + first * batch->ld, batch->ld);
    plr_real *S = batch->S + first; /* element (i, first) */
    for (unsigned i = 0; i < first; i++) {
        plr_rows_apply(&m->H, w->Vt + i * batch->ld, S);
        S += batch->rows - i - 1;
    }
    for (unsigned i = 0; i < PLR_ROWS; i++) {
        plr_rows_apply(&m->H, w->Vt + (first + i) * batch->ld, column);
        column[i] += m->R[i];
        for (unsigned r = i; r < PLR_ROWS; r++)
            S[r] = column[r];
        S += batch->rows - first - i - 1;
    }
    plr_rows_apply(&m->H, w->dx, column);
    for (unsigned r = 0; r < PLR_ROWS; r++)
        batch->E[WIDE * (first + r) + OF_DX] = column[r] - m->r[r];
    memset(column, 0, sizeof column);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        if (w->noise.open)
            plr_rows_apply(&m->H, w->noise.Wt + k * batch->ld, column);
        for (unsigned r = 0; r < PLR_ROWS; r++)
            batch->E[WIDE * (first + r) + OF_W + k] = column[r];
    }
}

/* sum += E^T y, E six columns from `at` on, y the negative of another one */
static void project(const plr_batch *batch, unsigned at, unsigned column,
                    plr_real to[PLR_POSE_DIM]) {
    plr_real sum[PLR_POSE_DIM]; /* in registers */
    memcpy(sum, to, sizeof sum);
    for (unsigned r = 0; r < batch->rows; r++)
        for (unsigned k = 0; k < PLR_POSE_DIM; k++)
            sum[k] = PLR_FMA(batch->E[WIDE * r + at + k], -batch->E[WIDE * r + column], sum[k]);
    memcpy(to, sum, sizeof sum);
}

/* Of two columns. */
static plr_real product(const plr_batch *batch, unsigned a, unsigned b) {
    plr_real sum = 0;
    for (unsigned r = 0; r < batch->rows; r++)
        sum = PLR_FMA(batch->E[WIDE * r + a], batch->E[WIDE * r + b], sum);
    return sum;
}

/* sum += E^T E, E six columns from `at` on, its upper triangle. */
static void add_squares(const plr_batch *batch, unsigned at, plr_real to[PLR_POSE_TRIANGLE]) {
    plr_real sum[PLR_POSE_TRIANGLE]; /* in registers */
    memcpy(sum, to, sizeof sum);
    for (unsigned r = 0; r < batch->rows; r++)
        plr_upper6_add(sum, batch->E + WIDE * r + at, batch->E + WIDE * r + at);
    memcpy(to, sum, sizeof sum);
}

/* The batch's information about the motion's noise: Lambda += E^T E, eta += E^T y, with E = U^-T H
 * W and y = U^-T (r - H dx); and eta of each column of the sensitivity. */
static void add_noise_information(plr_filter *f, const plr_batch *batch) {
    plr_noise *noise = &f->work.noise;
    add_squares(batch, OF_W, noise->Lambda);
    project(batch, OF_W, OF_DX, noise->eta);
    for (unsigned k = 0; k < f->camera.errors.count; k++)
        project(batch, OF_W, OF_S + k, noise->eta_of_S[k]);
}

/* The batch's information about the calibration: J += E^T E, eta += E^T y, with E = U^-T (H_s + H S). In the
 * block of six y stands first, as -y. */
static void add_learnt(plr_filter *f, const plr_batch *batch) {
    plr_learnt *to = &f->work.learnt;
    plr_real first[PLR_POSE_TRIANGLE] = {0}, *sum = first + PLR_POSE_DIM;
    add_squares(batch, OF_DX, first);
    for (unsigned k = 0; k < BESIDE_Y; k++) {
        to->eta[k] -= first[1 + k];
        for (unsigned l = k; l < BESIDE_Y; l++)
            to->J[PLR_CALIBRATIONS * k + l] += *sum++;
    }
    for (unsigned k = BESIDE_Y; k < PLR_CALIBRATIONS && k < f->camera.errors.count; k++) {
        plr_real less[PLR_POSE_DIM] = {0};
        project(batch, OF_DX, OF_S + k, less);
        to->eta[k] += less[0];
        for (unsigned l = 0; l < BESIDE_Y; l++)
            to->J[PLR_CALIBRATIONS * l + k] -= less[1 + l];
        for (unsigned l = BESIDE_Y; l <= k; l++)
            to->J[PLR_CALIBRATIONS * l + k] += product(batch, OF_S + l, OF_S + k);
    }
}

/* W -= V E, dx += V y and S += V y, each column of S with its own y: the rows of one product with E.
 * Where no motion is open, its columns are zero, so what stands in W is left as it is. */
static void update_estimate(plr_filter *f, const plr_batch *batch) {
    plr_workspace *w = &f->work;
    plr_real *rows[WIDE];
    const unsigned used = whole_tiles(f);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        rows[OF_W + k] = w->noise.Wt + k * batch->ld;
    rows[OF_DX] = w->dx;
    for (unsigned k = 0; k < PLR_CALIBRATIONS; k++)
        rows[OF_S + k] = f->belief.S[k];
    for (unsigned k = w->noise.open ? 0 : TILE; k + TILE <= used; k += TILE)
        plr_subtract_four_rows(batch->ld, batch->rows, batch->E + k, WIDE, w->Vt, batch->ld,
                               rows + k);
    if (used % TILE == 0)
        return;
    plr_real alone[PLR_BLOCK_ROWS];
    for (unsigned r = 0; r < batch->rows; r++)
        alone[r] = -batch->E[WIDE * r + used - 1];
    plr_combine_rows(batch->ld, batch->rows, alone, 1, w->Vt, batch->ld, rows[used - 1]);
}

/* With S = U^T U: V^T = U^-T (P H^T)^T, P -= V V^T, dx += V U^-T y. False, and nothing changed but
 * the batch and the workspace, if S is not positive (*factorised = false) or a variance would not
 * stay positive. */
static bool apply_batch(plr_filter *f, plr_batch *batch, bool *factorised) {
    plr_workspace *w = &f->work;
    *factorised = plr_cholesky_upper(batch->rows, batch->S);
    if (!*factorised)
        return false;
    plr_solve_upper_transposed(batch->rows, batch->ld, batch->S, w->Vt, batch->ld);
    plr_solve_upper_transposed(batch->rows, whole_tiles(f), batch->S, batch->E, WIDE);
    if (!plr_covariance_subtract(&f->belief, f->work.Vt, batch->rows))
        return false;
    if (w->noise.open)
        add_noise_information(f, batch);
    if (plr_calibration_estimated(&f->camera.errors) > 0)
        add_learnt(f, batch);
    update_estimate(f, batch);
    return true;
}

/* Applies `size` measurements, from number `at` on. */
static plr_status correct_by_batch(plr_filter *f, plr_sensed *sensed, unsigned at, unsigned size,
                                   plr_correction *result, plr_likelihood *likelihood) {
    PLR_ASSERT(0 < size && size <= PLR_BLOCK_OBSERVATIONS);
    plr_batch batch; /* not initialised: that would cost as much as a row of S */
    bool factorised;
    batch.rows = PLR_ROWS * size;
    batch.empty = 0;
    batch.ld = plr_covariance_ld(&f->belief);
    for (unsigned i = 0; i < size; i++) {
        plr_measurement m;
        const plr_sighting *row = at + i < sensed->seen ? next_row(sensed) : NULL;
        get_measurement(f, sensed, at + i, row, &m);
        stack(f, &m, PLR_ROWS * i, &batch);
        stack_sensitivity(f, row, &m, &batch, PLR_ROWS * i);
        batch.empty += row && plr_is_left_alone(row->seen);
    }
    if (apply_batch(f, &batch, &factorised)) {
        for (unsigned i = at; i < at + size; i++)
            result->applied += i < sensed->count;
        add_likelihood(likelihood, &batch);
    } else if (!factorised) {
        result->failed_batches++;
    } else {
        return plr_filter_diverge(f);
    }
    return PLR_OK;
}

/* True if the correction, of the pose by xi, is finite and small enough for a retraction. */
static bool is_applicable(const plr_filter *f, unsigned n, const plr_real xi[PLR_POSE_DIM]) {
    for (unsigned i = 0; i < n; i++)
        if (!plr_is_finite(f->work.dx[i]))
            return false;
    return plr_pose_is_correction(xi);
}

/* Corrects the estimate by work.dx, and P with it. *cut: as in plr_correction. */
static plr_status move_estimate(plr_filter *f, unsigned n, unsigned *cut) {
    PLR_ASSERT(n == plr_covariance_dim(&f->belief));
    plr_real A[PLR_POSE_SQUARE], xi[PLR_POSE_DIM]; /* of the pose after the held motion */
    *cut = 0;
    plr_motion_held_adjoint(&f->belief, A);
    plr_mat6_vec(xi, A, f->work.dx);
    if (!is_applicable(f, n, xi))
        return plr_filter_diverge(f);
    if (plr_has_block(&f->belief, PLR_BLOCK_BIAS))
        for (unsigned i = 0; i < PLR_BIAS_DIM; i++)
            f->belief.bias[i] += f->work.dx[plr_row_of(&f->belief, PLR_BLOCK_BIAS) + i];
    if (plr_has_block(&f->belief, PLR_BLOCK_VELOCITY))
        for (unsigned i = 0; i < PLR_VELOCITY_DIM; i++)
            f->belief.velocity[i] += f->work.dx[plr_row_of(&f->belief, PLR_BLOCK_VELOCITY) + i];
    plr_velocity_forget_bias(&f->source);
    *cut = plr_model_of(&f->belief)->retract(&f->belief, &f->camera, &f->work, f->work.dx);
    plr_pose_correct(&f->belief, xi);
    plr_covariance_make_up_for_rounding(&f->belief);
    return plr_covariance_is_positive(&f->belief) ? PLR_OK : plr_filter_diverge(f);
}

/* Applies all measurements, in batches of like size: the cost grows with its square. Those after one that
 * diverges are left out. */
static plr_status correct_by_all(plr_filter *f, plr_sensed *sensed, plr_correction *result,
                                 plr_likelihood *likelihood) {
    const unsigned all =
        sensed->count + (plr_velocity_informs_bias(&f->source) ? BIAS_MEASUREMENTS : 0);
    unsigned batches = (all + PLR_BLOCK_OBSERVATIONS - 1) / PLR_BLOCK_OBSERVATIONS, at = 0;
    plr_status status = PLR_OK;
    for (; batches > 0 && status == PLR_OK; batches--) {
        const unsigned size = (all - at + batches - 1) / batches;
        status = correct_by_batch(f, sensed, at, size, result, likelihood);
        at += size;
    }
    return status;
}

/* The first that is not good. */
static plr_status first_of(plr_status a, plr_status b) {
    return a != PLR_OK ? a : b;
}

static unsigned count_used(const plr_sightings *frame) {
    unsigned used = 0;
    for (unsigned k = 0; frame && k < frame->count; k++) {
        PLR_ASSERT(!frame->at[k].used || plr_is_matched(&frame->at[k]));
        used += frame->at[k].used;
    }
    return used;
}

plr_correction plr_correct(plr_filter *f, const plr_sightings *frame, const plr_measurement *given,
                           unsigned count) {
    plr_correction result = {.status = PLR_OK};
    const unsigned seen = count_used(frame), n = plr_covariance_dim(&f->belief);
    plr_sensed sensed = {frame, 0, seen, seen + count, given};
    if (!f->work.noise.open) { /* no motion has been applied */
        memset(f->work.dx, 0, n * sizeof *f->work.dx);
        memset(f->work.noise.motion_variance, 0, sizeof f->work.noise.motion_variance);
    }
    plr_calibration_begin(&f->camera, &f->work.learnt);
    plr_likelihood likelihood = {.det_root = {1, 0}};
    const bool informed = plr_velocity_informs_bias(&f->source);
    result.status = correct_by_all(f, &sensed, &result, &likelihood);
    result.moved = f->work.noise.open;
    memcpy(result.Lambda, f->work.noise.Lambda, sizeof result.Lambda);
    result.status = first_of(result.status, plr_filter_close_noise(f, result.nu));
    plr_calibration_learn(&f->belief, &f->camera, &f->work);
    if (result.moved)
        add_likelihood_of_motion(&likelihood, &f->work.noise, result.nu);
    result.innovation.d2 = likelihood.d2;
    result.innovation.log_det = 2 * plr_log_product_value(&likelihood.det_root);
    result.innovation.rows = likelihood.rows;
    if (result.applied == 0 && !result.moved && !informed)
        return result;
    result.status = first_of(result.status, move_estimate(f, n, &result.cut));
    return result;
}

plr_status plr_correct_towards(plr_filter *f, const plr_real xi[PLR_POSE_DIM]) {
    const unsigned n = plr_covariance_dim(&f->belief);
    unsigned cut;
    if (!plr_covariance_shift(&f->belief, xi, f->work.dx))
        return PLR_OK;
    memset(f->work.noise.motion_variance, 0, sizeof f->work.noise.motion_variance);
    return move_estimate(f, n, &cut);
}
