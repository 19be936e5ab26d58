// SPDX-License-Identifier: MIT
/*
 * Sums over frames of nu, the difference between the motion by pictures and the one by twists, in which
 * older frames count less, and how unlikely they are if both are as stated (docs/MATH.md 17).
 */
#ifndef PLR_FILTER_WINDOWS_H
#define PLR_FILTER_WINDOWS_H

#include <stdbool.h>

#include "pelorus/state.h"

/* plr_consistency.windows: they look back some 4, 19 and 130 frames. */
enum { PLR_FASTEST_WINDOW, PLR_FAST_WINDOW, PLR_SLOW_WINDOW };

/* A sum s in its sigmas, squared: s^T (V + floor I)^-1 s, chi-square with 6 degrees of freedom. `turns`
 * is the part that no translation explains, 3 degrees of freedom. */
typedef struct plr_statistic {
    plr_real all, turns;
} plr_statistic;

/* What biases that no frame teaches add to nu: the same in each frame. */
typedef struct plr_kept_bias {
    plr_real of_nu[PLR_POSE_TRIANGLE]; /* its covariance, 6x6 packed upper triangle */
    unsigned frames;                   /* for how many frames it has been so; 0: not at all */
} plr_kept_bias;

void plr_windows_clear(plr_filter *f);

/* Adds a frame's nu and its covariance V, 6x6 packed upper triangle; to the slow window too if `slow`. */
void plr_windows_add(plr_filter *f, const plr_real nu[PLR_POSE_DIM],
                     const plr_real V[PLR_POSE_TRIANGLE], bool slow);

/* X: the part of the motion's covariance in its sigmas that is the biases', 6x6, if this frame teaches
 * them nothing, else NULL. nu is V times the motion's error in its sigmas, plus noise of the pixels. */
void plr_windows_keep_bias(const plr_filter *f, const plr_real *X,
                           const plr_real V[PLR_POSE_TRIANGLE], plr_kept_bias *kept);

/* The larger ones of the two windows that look back least, and the one that looks back most. `floor`
 * keeps directions of which the pictures say little out of it. kept may be NULL. */
plr_statistic plr_windows_fast(const plr_filter *f, plr_real floor, const plr_kept_bias *kept);
plr_statistic plr_windows_slow(const plr_filter *f, plr_real floor, const plr_kept_bias *kept);

/* n = (V + floor I)^-1 nu: the estimate by the pictures alone, without the twists' prior. */
void plr_by_pictures_alone(const plr_real nu[PLR_POSE_DIM], const plr_real V[PLR_POSE_TRIANGLE],
                           plr_real floor, plr_real n[PLR_POSE_DIM]);

/* That of the fastest window, as a mean of a frame. */
void plr_windows_mean(const plr_filter *f, plr_real floor, plr_real n[PLR_POSE_DIM]);

#endif
