// SPDX-License-Identifier: MIT
/*
 * The textbook's extended Kalman filter at full size, with either of the project's two models: one
 * state of pose and ALL landmarks, four rows an observation, all observations of a frame in one gain,
 * in double, on OpenBLAS and LAPACKE (or plain loops, support/oracle.h). With `world` it is the course
 * report's filter as the report has it (III.1 to III.14); with `body` (docs/MATH.md 9 to 11) a frame's
 * motion is found first. It is the oracle of the tests for whole frames, and pelorus-textbook. Of the
 * library it takes settings and types alone.
 *
 * Errors: pose xi = (rho, theta) on the right, T = T^ Exp(xi); biases; and of a landmark the error of
 * its point: of m in the world (`world`) or of q in the left camera (`body`). Where the library has
 * the polar chart, this one stays with points: a linear filter does not depend on the chart, and what
 * the chart does to a correction is written without its basis (body.h). Rows of P: xi (6), db (6,
 * where biases are estimated), then three a landmark. Of P the lower triangle is kept, row by row,
 * `ld` numbers a row.
 *
 * In `body` P is of the state before the motion since the landmarks were last brought up to date; the
 * motion's error n, T = T^ D Exp(n), is kept beside it with all it has in common with the state.
 *
 * Each function says what it computes; the sources of the equations are in docs/MATH.md.
 */
#ifndef PELORUS_TEXTBOOK_H
#define PELORUS_TEXTBOOK_H

#include <stdbool.h>
#include <stddef.h>

#include "pelorus/settings.h"
#include "pelorus/types.h"

enum { TEXTBOOK_ROWS = 4 }; /* of an observation: uL, vL, uR, vR */

typedef struct textbook_landmark {
    double x[3];   /* `world`: m in the world; `body`: q in the left camera; m */
    double beyond; /* `body`: the estimate's inverse range less the point's, 1/m: of far points */
    double range_shift, d2,
        norm2; /* `body`: what a frame makes of it before it is corrected (search.h) */
    uint32_t id, times_seen, times_gated;
    plr_time_ns last_seen_ns;
    bool known;    /* from a map */
    bool rejected; /* by the gate, in the last frame that saw it */
    bool dropped;  /* a locked gate was wrong about it: seen again, it is a new one in its place */
} textbook_landmark;

typedef struct textbook {
    plr_config config; /* `slots` is not looked at */
    plr_calibration camera;
    double T_CB[16], Ad_CB[36];

    double T_WB[16], bias[6];
    unsigned count, most; /* landmarks, and how many there is room for */
    textbook_landmark *landmarks;
    double *P;
    size_t ld;
    double walked_s; /* since the biases' walk was last added */
    bool gate_open;  /* a gate of fixed pixels lets through what the covariance explains */
    bool diverged;   /* a variance has ceased to be positive */

    /* `body`: the motion since P, its error's covariance, and that with the state, ld x 6 */
    bool pending;
    double D[16], M[36];
    double *C;

    unsigned most_seen; /* observations in a frame */
    double *rows;       /* H P: 4 most_seen x n */
    double *pose, *own; /* rows of P, whole: the pose's six and one landmark's three */
    double *S, *innovation, *correction;
    double *noise, *shared;    /* `body`: n x 6 each */
    double motion_variance[6]; /* `body`: variances of the motion that this frame has applied */
    double *blocks;            /* `body`: 3x3 a landmark */
    unsigned *matched;         /* landmark of each observation, count where there is none */
    struct textbook_sighting *sightings; /* `body`: most_seen (search.h) */
    double *considered; /* zeros for H, 4 most_seen x n, if the next frame may not change the biases
                           (consider.h); else NULL */
} textbook;

/* What a frame came to. */
typedef struct textbook_report {
    unsigned matched, used, gated;
    bool failed; /* S could not be factorised: nothing was used */
    double nis;
    double d2,
        log_det; /* y^T S^-1 y and ln det S of all that was used; with vL and vR as their mean,
                           as the filter takes them: without what their difference adds */
} textbook_report;

bool textbook_is_body(const textbook *t);

/* Bytes that textbook_init asks for. */
size_t textbook_bytes(const plr_config *config, unsigned most, unsigned most_seen);

/* At identity, with start_sigma^2 I (zero in mapping) and the bias prior; room for `most` landmarks
 * and frames of `most_seen` observations. False if there is no memory. */
bool textbook_init(textbook *t, const plr_calibration *calibration, const plr_config *config,
                   unsigned most, unsigned most_seen);
void textbook_free(textbook *t);

/* Camera, settings and identity alone, without memory: for what only asks about poses. */
void textbook_stand(textbook *t, const plr_calibration *calibration, const plr_config *config);

/* As after init, in the memory that it has. */
void textbook_reset(textbook *t);

/* Sets pose and pose covariance, 6x6; drops the landmarks. Biases stay. */
void textbook_set_pose(textbook *t, const plr_pose *T_WB, const double P_xi[36]);

/* Sets the bias and its variances. Before any landmark. */
void textbook_set_bias(textbook *t, const double mean[6], const double variance[6]);

/* III.8, III.14: T <- T Exp(s (u - b)), P <- F P F^T + W, s `seconds` of an interval of the reading; in
 * `body` the motion's error alone. W is sigma^2 s interval, or with noise = step sigma^2 s / interval. */
void textbook_hold(textbook *t, const plr_twist *twist, double seconds, double interval);

/* T <- T_WB, exactly. */
void textbook_move_to(textbook *t, const plr_pose *T_WB);

/* III.5, III.10: match, gate, and one gain for all that passed, by the observations of landmarks that
 * it holds. Ids may stand once in a frame; it has at most `most_seen` observations. The biases' walk
 * is added before. In `body` a frame that uses nothing and makes no landmark leaves the motion pending. */
textbook_report textbook_update(textbook *t, plr_time_ns t_ns, const plr_frame *frame);

/* A new landmark from pixels (Sigma_m of III-F, or from their noise); `at` is its place in the
 * state: count, or that of one that it replaces. False, and nothing done, where the pixels fail the
 * settings' tests or there is no room. */
bool textbook_create(textbook *t, unsigned at, plr_time_ns t_ns, const plr_observation *seen);

/* Does an observation pass the tests that a new landmark must pass? */
bool textbook_is_worth_a_landmark(const plr_config *config, const plr_calibration *camera,
                                  const plr_observation *seen);

/* A landmark of known place and covariance. False if there is no room. */
bool textbook_insert_known(textbook *t, const plr_landmark *known);

/* Takes a landmark out of the state: its rows and columns of P. */
void textbook_remove(textbook *t, unsigned landmark);

/* The place of an id among the landmarks that are not dropped, or among all; count if it is not
 * there. */
unsigned textbook_find(const textbook *t, uint32_t id);
unsigned textbook_place(const textbook *t, uint32_t id);

/* Landmark in the world. */
void textbook_landmark_of(const textbook *t, unsigned landmark, plr_landmark *out);

/* The pose's covariance now, whatever motion is pending, 6x6. */
void textbook_pose_covariance(const textbook *t, double P_xi[36]);

/* The pose at which P stands: before the motion that is pending. */
void textbook_reference(const textbook *t, double T_WB[16]);

/* Rows of P in use; the first row of a landmark; P(i, j); its trace, with the pose's part of now. */
unsigned textbook_dim(const textbook *t);
unsigned textbook_row(const textbook *t, unsigned landmark);
double textbook_covariance(const textbook *t, unsigned i, unsigned j);
double textbook_trace(const textbook *t);

#endif
