// SPDX-License-Identifier: MIT
/*
 * A frame that does not teach the twists' biases: a wheel that slips or a scene that moves is no bias.
 * Pose, landmarks and all covariances with the biases are corrected as usual, so that what is left
 * is the Schmidt ("consider") update: the biases' own numbers stay (docs/MATH.md 17).
 */
#ifndef PLR_FILTER_CONSIDERED_BIAS_H
#define PLR_FILTER_CONSIDERED_BIAS_H

#include <stdbool.h>

#include "pelorus/state.h"

typedef struct plr_considered_bias {
    plr_real bias[PLR_BIAS_DIM], P_bb[PLR_BIAS_DIM * PLR_BIAS_DIM];
    plr_real S_b[PLR_CALIBRATIONS][PLR_BIAS_DIM];
    plr_real seconds; /* of the motion that is pending */
    bool considered;
} plr_considered_bias;

/* Notes the biases before a frame's motion is applied, if it shall not change them, nor the
 * calibration. */
void plr_bias_consider(plr_filter *f, bool hold, plr_considered_bias *before);

/* After the correction: puts them back as they were, and lets them walk. */
void plr_bias_restore(plr_filter *f, const plr_considered_bias *before);

#endif
