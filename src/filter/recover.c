// SPDX-License-Identifier: MIT
/* Beginning anew at a pose: the landmarks and all correlations are dropped. And recovery after the covariance
 * has lost positivity, which does so at the pose that it has. */
#include <string.h>

#include "filter/filter_internal.h"
#include "math/dense.h"
#include "math/se3.h"
#include "math/small.h"
#include "process/process.h"
#include "process/velocity.h"
#include "state/blocks.h"
#include "state/calibration.h"
#include "state/covariance.h"
#include "state/motion.h"
#include "state/sensitivity.h"
#include "supervise/supervise.h"

static void pack(plr_filter *f, const plr_real P[PLR_POSE_SQUARE]) {
    for (unsigned i = 0, at = 0; i < PLR_POSE_DIM; i++)
        for (unsigned j = 0; j <= i; j++)
            f->recovery_P[at++] = P[PLR_POSE_DIM * i + j];
}

static void unpack(const plr_filter *f, plr_real P[PLR_POSE_SQUARE]) {
    for (unsigned i = 0, at = 0; i < PLR_POSE_DIM; i++)
        for (unsigned j = 0; j <= i; j++, at++)
            P[PLR_POSE_DIM * i + j] = P[PLR_POSE_DIM * j + i] = f->recovery_P[at];
}

void plr_filter_begin_bias(plr_filter *f, const double variance[PLR_BIAS_DIM]) {
    plr_velocity_forget_bias(&f->source);
    plr_covariance_begin_diagonal(&f->belief, PLR_BLOCK_BIAS, variance);
}

void plr_filter_begin_velocity(plr_filter *f) {
    const double v = (double)f->source.start_velocity_variance;
    const double variance[PLR_VELOCITY_DIM] = {v, v, v};
    if (plr_has_block(&f->belief, PLR_BLOCK_VELOCITY))
        plr_covariance_begin_diagonal(&f->belief, PLR_BLOCK_VELOCITY, variance);
}

void plr_filter_store_for_recovery(plr_filter *f) {
    plr_real P[PLR_POSE_SQUARE];
    plr_covariance_get(&f->belief, PLR_BLOCK_POSE, PLR_BLOCK_POSE, P);
    pack(f, P);
}

/* S, drivers x drivers: the covariance of biases and velocity when the filter began, and of theta
 * in P. */
static void prior_of_drivers(const plr_filter *f, const plr_real P[PLR_POSE_SQUARE], plr_real *S) {
    const unsigned first = f->belief.layout.driver, drivers = f->belief.layout.drivers;
    for (unsigned d = 0; d < drivers; d++) {
        const unsigned row = first + d, bias = plr_row_of(&f->belief, PLR_BLOCK_BIAS);
        plr_real *own = &S[(drivers + 1) * d];
        if (row >= bias)
            *own = plr_bias_prior_variance(&f->source, row - bias);
        else if (row >= PLR_POSE_DIM)
            *own = f->source.start_velocity_variance;
        else
            for (unsigned e = 0; first + e < PLR_POSE_DIM; e++)
                S[drivers * d + e] = P[PLR_POSE_DIM * row + first + e];
    }
}

/* P <- Ad(D^-1) P Ad(D^-1)^T + Q + B S B^T, with S the covariance of the biases' prior, because
 * their present covariance may be wrong. */
void plr_filter_propagate_recovery(plr_filter *f) {
    const plr_motion *m = &f->motion;
    plr_real R[9], A[PLR_POSE_SQUARE], P[PLR_POSE_SQUARE], carried[PLR_POSE_SQUARE],
        S[PLR_DRIVERS * PLR_DRIVERS] = {0}, BSB[PLR_POSE_SQUARE];
    plr_se3_rotation(R, m->E);
    plr_se3_adjoint_inverse(A, R, m->p);
    unpack(f, P);
    plr_sandwich6(carried, A, P);
    prior_of_drivers(f, P, S);
    plr_sandwich_drivers(BSB, f->belief.layout.drivers, m->B, S);
    for (unsigned i = 0; i < PLR_POSE_SQUARE; i++)
        carried[i] += m->Q[i] + BSB[i];
    pack(f, carried);
}

plr_picture_decision plr_filter_begin_anew(plr_filter *f, const plr_real P[PLR_POSE_SQUARE],
                                           bool relocated) {
    double P_xi[PLR_POSE_SQUARE];
    pack(f, P);
    for (unsigned i = 0; i < PLR_POSE_SQUARE; i++)
        P_xi[i] = (double)P[i];
    f->belief.count = 0;
    f->totals.widened++;
    f->frames_off_the_map = 0;
    f->work.noise.open = 0;
    memset(&f->belief.held, 0, sizeof f->belief.held);
    plr_motion_clear(&f->belief, &f->motion);
    plr_covariance_begin(&f->belief, PLR_BLOCK_POSE, P_xi);
    plr_filter_begin_velocity(f);
    return plr_supervise_begun_anew(&f->supervisor, relocated);
}

void plr_filter_begin_prior_bias(plr_filter *f, plr_real sigmas) {
    double variance[PLR_POSE_DIM];
    if (!plr_has_block(&f->belief, PLR_BLOCK_BIAS))
        return;
    for (unsigned i = 0; i < PLR_POSE_DIM; i++) {
        const plr_real prior = plr_bias_prior_variance(&f->source, i),
                       off = f->belief.bias[i] - f->source.bias_prior[i];
        if (!(off * off <= sigmas * sigmas * prior))
            f->belief.bias[i] = f->source.bias_prior[i];
        variance[i] = (double)prior;
    }
    plr_filter_begin_bias(f, variance);
}

plr_status plr_filter_diverge(plr_filter *f) {
    f->totals.diverged_ns = f->belief.t_ns;
    f->work.noise.open = 0; /* W is not added to P any more */
    return PLR_E_DIVERGED;
}

plr_status plr_filter_close_noise(plr_filter *f, plr_real nu[PLR_POSE_DIM]) {
    const plr_status status = plr_covariance_close_noise(&f->belief, &f->camera, &f->work, nu);
    return status == PLR_OK ? PLR_OK : plr_filter_diverge(f);
}

void plr_filter_recover(plr_filter *f) {
    plr_real P[PLR_POSE_SQUARE];
    if (f->motion.pending)
        plr_filter_propagate_recovery(f);
    unpack(f, P);
    plr_supervise_enlarge(&f->supervisor, f->motion.E, f->motion.p, P);
    if (plr_sensitivity_is_finite(&f->belief))
        plr_sensitivity_add_to(&f->belief, &f->camera, plr_row_of(&f->belief, PLR_BLOCK_POSE),
                               PLR_POSE_DIM, P);
    f->totals.recoveries++;
    (void)plr_filter_begin_anew(f, P, false);
    plr_calibration_doubt(&f->camera);
    plr_filter_begin_prior_bias(f, 4); /* what is known of them may be what has broken down */
}
