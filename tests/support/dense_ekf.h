// SPDX-License-Identifier: MIT
/*
 * The textbook extended Kalman filter, as the oracle for whole frames: full matrices in double, one
 * Jacobian a step, every observation of a frame in one gain, Joseph's form. It follows
 * docs/MATH.md and shares nothing with src/.
 *
 * Errors: pose (rho, theta) on the right, biases, and for each landmark the error of its point: of q
 * in the camera (`body`) or of m in the world (`world`). Where the filter has the polar chart, this
 * one stays with points: a linear filter does not depend on the chart, and what the chart does to a
 * correction is written without its basis.
 *
 * In `body` the error n of a frame's motion is a part of the joint covariance from reading to reading,
 * and a frame is linearised at the motion that its observations tell (dense_first.h): the prior mean is
 * then no longer zero, and all of it goes into one gain. Nothing is kept outside of P.
 */
#ifndef PELORUS_TEST_DENSE_EKF_H
#define PELORUS_TEST_DENSE_EKF_H

#include <stdbool.h>

#include "pelorus/filter.h"

enum { DENSE_MAX = 64, DENSE_MAX_DIM = 12 + 3 * DENSE_MAX };

typedef struct dense_ekf {
    plr_config config;
    plr_calibration camera;
    double T_CB[16], Ad_CB[36];

    double T_WB[16];
    double bias[6];
    unsigned count;
    uint32_t id[DENSE_MAX];
    bool known[DENSE_MAX]; /* from a map */
    double x[DENSE_MAX][3];
    double P[DENSE_MAX_DIM * DENSE_MAX_DIM]; /* dim x dim, row by row */
    double walked_s;                         /* for the bias walk */

    /* `body`: the motion D since the landmarks were last brought up to date, T_WB = T D, with an error
     * n, T = T^ D Exp(n). P is of the state before the motion. */
    bool pending;
    double D[16];
    double M[36];                /* covariance of n */
    double C[DENSE_MAX_DIM * 6]; /* of the state with n */
} dense_ekf;

/* What a frame came to. */
typedef struct dense_report {
    unsigned matched, used, gated;
    double nis;
} dense_report;

/* Rows of P: 6 (+ 6) + 3 count. */
unsigned dense_dim(const dense_ekf *e);

/* The first row of a landmark. */
unsigned dense_row(const dense_ekf *e, unsigned landmark);

/* At identity, with start_sigma^2 I and the bias prior. */
void dense_init(dense_ekf *e, const plr_calibration *calibration, const plr_config *config);

/* Sets pose and pose covariance; drops the landmarks. */
void dense_set_pose(dense_ekf *e, const plr_pose *T_WB, const double P_xi[36]);

/* T <- T Exp(seconds (u - b)). `world`: with the whole of P; `body`: with the joint covariance of state
 * and motion. `interval` is the reading's own, of which `seconds` may be a part. */
void dense_hold(dense_ekf *e, const plr_twist *twist, double seconds, double interval);

/* T <- T_WB without noise. */
void dense_move_to(dense_ekf *e, const plr_pose *T_WB);

/* The pose's covariance now, whatever motion is pending, 6x6. */
void dense_pose_covariance(const dense_ekf *e, double P_xi[36]);

/* Match, gate, update, retract, by the observations of landmarks that it holds. */
dense_report dense_update(dense_ekf *e, const plr_frame *frame);

/* What the filter adds to the landmarks' variances at the end of a frame (docs/NUMERICS.md 1): a rounding of
 * each, eight of those that it saw, in its own charts. */
void dense_make_up_for_rounding(dense_ekf *e, const plr_frame *frame, double rounding);

/* New landmarks from the others, in the frame's order and while there is room. Returns how many. */
unsigned dense_create(dense_ekf *e, const plr_frame *frame);

/* A landmark of known place and covariance in the world. */
void dense_insert_known(dense_ekf *e, const plr_landmark *known);

/* Drops the landmark of that id, if there is one. */
void dense_remove(dense_ekf *e, uint32_t id);

/* Landmark in the world: position and covariance. */
void dense_landmark(const dense_ekf *e, unsigned landmark, double p_W[3], double P_W[9]);

/* The largest differences between oracle and filter. */
typedef struct dense_gap {
    double position_m, rotation_rad, bias;
    double landmark;   /* |x - x'| over its distance */
    double covariance; /* |P_ij - P'_ij| / sqrt(P_ii P_jj), in the oracle's errors */
} dense_gap;

/* Compares after a frame. False if they do not hold the same landmarks, or one has a motion pending and
 * the other has not. */
bool dense_compare(const dense_ekf *e, const plr_filter *f, dense_gap *gap);

#endif
