// SPDX-License-Identifier: MIT
/*
 * How a frame's motion is found in the textbook's `body`, before the frame's observations enter it
 * (docs/MATH.md 10): the least of |z|^2 + sum rho(|residual|^2) over the motions D Exp(L z), by
 * Levenberg and Marquardt, with each landmark's own covariance. In double and in errors of points; an
 * observation is left out by adding up all the others. What it finds of each landmark that the frame
 * sees goes into the landmark: `range_shift`, from its inverse range to where it is linearised (1/m), d2
 * without what the rows of an image differ by, and norm2, the squared residual.
 */
#ifndef PELORUS_TEXTBOOK_SEARCH_H
#define PELORUS_TEXTBOOK_SEARCH_H

#include "textbook/textbook.h"

/* Where a frame is linearised. */
typedef struct search_result {
    double L[36]; /* the motion's prior: n = L nu, nu ~ N(0, I), 6x6 lower triangle */
    double z[6];  /* nu there */
    unsigned accepted;
} search_result;

/* A landmark that the frame sees. */
typedef struct textbook_sighting {
    unsigned landmark;
    const plr_observation *o;
    double V[18], P[9];   /* correlation of its point with nu, 3x6; covariance once nu is known */
    bool in_front;        /* at the point looked at last */
    double J[9], S[9];    /* d z / d q, and S = J P J^T + R, there */
    double a[18], rho[3]; /* d z / d nu and residual, whitened */
    double weight, cost, best_S[9];
    double prior_d2; /* d2 by the twists alone; infinite if there is no place to linearise */
    bool left_out;   /* for now: the gate rejects it */
    double active;
} textbook_sighting;

/* L L^T = the covariance of the pending motion, with the small part of the biases' effect that is
 * charged as noise besides (docs/MATH.md 10). Columns that are zero to rounding are zero. */
void search_prior(const textbook *t, double L[36]);

/* Fills all but L from the frame's observations of landmarks that are not yet moved. */
void search_motion(textbook *t, const plr_frame *frame, search_result *found);

#endif
