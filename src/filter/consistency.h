// SPDX-License-Identifier: MIT
/*
 * Tests whether twists and pictures agree. Each frame yields nu, the difference between the motion
 * seen in the pictures and the one by the twists, in units of the twists' sigmas. In single frames,
 * and in sums in which older frames count less, nu must look like white noise. Where it does not,
 * the twists get less weight, the pose's covariance is enlarged to cover the poses by twists and by
 * pictures, and health says so until the two agree again (docs/MATH.md 17).
 */
#ifndef PLR_FILTER_CONSISTENCY_H
#define PLR_FILTER_CONSISTENCY_H

#include <stdbool.h>

#include "pelorus/types.h"
#include "state/motion.h"

/* Start: no frame seen, no disagreement. */
void plr_consistency_clear(plr_filter *f);

/* Enlarges the twists' noise Q of this frame as long as they are contradicted. Call it before
 * plr_motion_prior. `believed` receives the prior with the original Q. */
void plr_consistency_widen(plr_filter *f, plr_applied_motion *believed);

/* Adds the result of a frame: nu with prior N(0, I), in units of applied->L, and its information
 * Lambda, 6x6 packed upper triangle, prior included. `moved`: by how much the frame moved the pose
 * from where the twists had put it, m and rad in the body. `kept_bias`: the part of nu's covariance that
 * is the biases', 6x6, if the frame teaches them nothing (filter/considered_bias.h), else NULL.
 * `outright`: this frame contradicts the twists by itself. Where the last reading is old (plr_health_readings_are_old), vision is followed
 * all the same, but there is no pose by twists that the true one could be. */
void plr_consistency_add(plr_filter *f, const plr_applied_motion *believed,
                         const plr_applied_motion *applied, const plr_real nu[PLR_POSE_DIM],
                         const plr_real Lambda[PLR_POSE_TRIANGLE],
                         const plr_real moved[PLR_POSE_DIM], const plr_real *kept_bias,
                         bool outright);

/* Ends a contradiction, because the points have said that the twists are right (filter/votes.h). The
 * difference stays: until pictures and twists agree the covariance covers both poses. */
void plr_consistency_trust_twists(plr_filter *f);

/* Adds the counts of a frame; `lost`: the frame lost the pose (plr_health). Returns bits of
 * plr_reason. */
uint32_t plr_consistency_judge(plr_filter *f, const plr_report *report, bool lost);

/* The told covariance covers the present pose and the one by the twist n from it, m and rad in the body,
 * and the pose may be wrong, until pictures and twists have agreed as after a contradiction. `nu` is what was
 * measured of it in sigmas of what was believed, and `noise` the expected square of nu by chance. */
void plr_consistency_cover(plr_filter *f, const plr_real n[PLR_POSE_DIM],
                           const plr_real nu[PLR_POSE_DIM], plr_real noise);

/* The pose may be wrong, until pictures and twists have agreed for as long as after a contradiction. */
void plr_consistency_doubt(plr_filter *f);

/* True if frames teach the biases of twists nothing: from a contradiction, a lost lock or a frozen
 * picture on until the pose is out of doubt, for a scene may move a little less for some frames; but if
 * it takes long, only while the twists are contradicted. */
bool plr_consistency_keeps_biases(const plr_filter *f);

/* While a contradiction lasts, enlarges the pose's present covariance P_xi, 6x6, so that it covers
 * the poses by twists and by pictures: by d d^T, where d is the difference between the two, and by
 * a part of |d|^2 in all directions. */
void plr_consistency_enlarge(const plr_filter *f, plr_real P_xi[PLR_POSE_SQUARE]);

#endif
