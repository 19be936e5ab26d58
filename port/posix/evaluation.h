// SPDX-License-Identifier: MIT
/*
 * Estimate against truth. Both are collected while the recording runs, and compared at its end, at
 * frames that have a TRUTH of equal time.
 *
 * With T^ the estimate and T the truth, A = T^_0 T_0^-1 at the first such frame:
 *   err0_m        RMS of |p^_k - p(A T_k)|
 *   rot_deg       RMS angle of R^_k^T R(A T_k)
 *   ate_m         RMS of |p^_k - p(A' T_k)| with the best rigid A', no scale
 *   nees_per_dof  mean of e^T P^-1 e / 6, e = Log(T^_k^-1 A T_k), the first frame left out
 */
#ifndef PELORUS_POSIX_EVALUATION_H
#define PELORUS_POSIX_EVALUATION_H

#include "pelorus/wire.h"
#include "posix/samples.h"

typedef struct evaluation {
    samples estimates, truths;
} evaluation;

/* NaN where a figure cannot be had. */
typedef struct evaluation_figures {
    size_t frames; /* with truth */
    double err0_m, ate_m, rot_deg, nees_per_dof;
    size_t not_positive; /* frames left out of NEES: their covariance has no inverse */
} evaluation_figures;

void evaluation_init(evaluation *e);
void evaluation_free(evaluation *e);

/* The pose after a frame. */
void evaluation_add_estimate(evaluation *e, const plr_pose_message *pose);

/* One that is not finite is left out. Of two at the same time the later counts. */
void evaluation_add_truth(evaluation *e, const plr_truth *truth);

/* A: the truth brought to the estimate's start; identity where there is no frame with truth. Sorts what
 * was collected. */
void evaluation_start(evaluation *e, plr_pose *A);

/* Sorts what was collected. */
void evaluation_figures_of(evaluation *e, evaluation_figures *figures);

#endif
