// SPDX-License-Identifier: MIT
/* The Kalman correction by measurements, in batches (docs/MATH.md 10). */
#ifndef PLR_FILTER_CORRECTION_H
#define PLR_FILTER_CORRECTION_H

#include "pelorus/state.h"
#include "sensor/measurement.h"

/* All innovations of a correction taken together, as the filter believed them to be distributed
 * before it saw them: -2 ln of their density is d2 + log_det + rows ln(2 pi). */
typedef struct plr_innovation {
    plr_real d2;      /* y^T S^-1 y */
    plr_real log_det; /* ln det S */
    unsigned rows;    /* of y */
} plr_innovation;

/* The result of a correction. */
typedef struct plr_correction {
    plr_status status;         /* PLR_OK or PLR_E_DIVERGED */
    unsigned applied;          /* measurements in batches that were applied */
    unsigned failed_batches;   /* left out: S could not be factorised */
    unsigned cut;              /* landmark corrections limited: PLR_REASON_RANGE_LIMITED */
    plr_real nu[PLR_POSE_DIM]; /* estimated noise of the motion, in units of its sigmas */
    plr_real Lambda
        [PLR_POSE_TRIANGLE]; /* information about nu, prior included: 6x6, packed upper triangle */
    plr_innovation innovation; /* of all that was applied */
    bool moved;                /* a motion with noise was applied: nu and Lambda are filled */
} plr_correction;

/* Applies the measurements that were kept (sensor/kept.h) of the rows of a frame that are to be
 * used, then the `given` ones, and the information about the biases that velocities have added since the
 * last correction (process/velocity.h). All are linearised at the current estimate, and the estimate is
 * corrected once, at the end. PLR_E_DIVERGED if a variance would not be positive or the correction is not
 * finite; the result of the batches before is kept. `frame` or `given` may be NULL. */
plr_correction plr_correct(plr_filter *f, const plr_sightings *frame, const plr_measurement *given,
                           unsigned count);

/* T <- T Exp(xi), and everything else as it is expected to be if the pose is there: x <- x + g with
 * g = P_xp P_pp^-1 xi. P grows by g g^T, so that the estimate of before is one sigma away. Nothing
 * happens if P_pp cannot be factorised. For a pose that was found otherwise, where what is seen shall
 * be linearised; no motion may be pending. PLR_E_DIVERGED as above. */
plr_status plr_correct_towards(plr_filter *f, const plr_real xi[PLR_POSE_DIM]);

#endif
