// SPDX-License-Identifier: MIT
/*
 * `body` in the textbook: landmarks stand in the left camera, so that a motion moves all of them, and
 * a correction goes through the polar chart, which is written here without a basis (docs/MATH.md 5,
 * 10, 11).
 */
#ifndef PELORUS_TEXTBOOK_BODY_H
#define PELORUS_TEXTBOOK_BODY_H

#include "textbook/textbook.h"

/* No motion is pending any more. */
void body_forget_motion(textbook *t);

/* n <- A n + N b-error + noise of variances W for a step D of the body, jointly with the state before
 * the motion. N is 6x6 or NULL. */
void body_hold(textbook *t, const double D[16], const double A[36], const double *N,
               const double W[6]);

/* Landmarks and P along with a motion that is known exactly. T_WB is there already. */
void body_move(textbook *t, const double D[16]);

/* Finds a frame's motion, and brings the state there; `correction` takes what the prior says of the
 * errors there. True if observations have been judged on the way (landmark's d2, norm2). */
bool body_catch_up(textbook *t, const plr_frame *frame);

/* Brings the state up to a pending motion without a frame. */
void body_settle(textbook *t);

/* The correction of the landmarks: the rigid motion that they have in common, then the chart for the
 * rest of each; and P along with that and with the pose's correction. */
void body_retract(textbook *t);

/* What is beyond a landmark's point, as an error of the point. */
void body_beyond(const textbook_landmark *l, double e[3]);

/* A correction of a point as the chart makes it: bearing and inverse range. q~ = retr(q, Jw e), and J
 * the transport Ji(q~) diag(M, 1) Jw(q), 3x3. */
void body_polar_step(const double q[3], const double e[3], double moved[3], double J[9]);

/* The rigid motion eta of the body that the corrections of points q have in common, where the pose's
 * own, xi, weighs a tenth, and 0 as much as t->motion_variance allows beside what the corrections scatter by, at
 * most the noise of a pixel. A point's correction counts as the angle that it makes, and along the ray as
 * the disparity. */
typedef struct body_fit {
    double A[36], b[6], square;
    unsigned heard; /* landmarks that have been added */
} body_fit;

void body_fit_add(const textbook *t, body_fit *fit, const double q[3], const double e[3]);
void body_fit_solve(const textbook *t, body_fit *fit, const double xi[6], double eta[6]);

/* Without the common motion eta, its camera's being undone by `back`: carries a point q there, and its
 * error e becomes what is left, at the same angle and the same change of inverse range as at q. */
void body_along(const textbook *t, const double eta[6], const double back[16], double q[3],
                double e[3]);

#endif
