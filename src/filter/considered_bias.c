// SPDX-License-Identifier: MIT
#include "filter/considered_bias.h"

#include <string.h>

#include "filter/consistency.h"
#include "process/process.h"
#include "process/velocity.h"
#include "state/blocks.h"
#include "state/covariance.h"
#include "state/motion.h"

/* Not with an IMU, whose biases, velocity and tilt are found together after a start in motion; nor
 * if another sensor has told of the biases since the last frame. */
static bool may_be_considered(const plr_filter *f) {
    return plr_has_block(f, PLR_BLOCK_BIAS) && !plr_has_block(f, PLR_BLOCK_VELOCITY) &&
           !plr_velocity_informs_bias(f);
}

/* X <- L^-1 X L^-T, X symmetric */
static void whiten(const plr_real L[PLR_POSE_SQUARE], plr_real X[PLR_POSE_SQUARE]) {
    for (unsigned side = 0; side < 2; side++) {
        plr_motion_solve(L, PLR_POSE_DIM, X, PLR_POSE_DIM);
        for (unsigned r = 0; r < PLR_POSE_DIM; r++)
            for (unsigned c = 0; c < r; c++) {
                const plr_real upper = X[PLR_POSE_DIM * c + r];
                X[PLR_POSE_DIM * c + r] = X[PLR_POSE_DIM * r + c];
                X[PLR_POSE_DIM * r + c] = upper;
            }
    }
}

void plr_bias_consider(const plr_filter *f, const plr_real L[PLR_POSE_SQUARE], bool outright,
                       plr_considered_bias *before) {
    before->considered = (outright || plr_consistency_keeps_biases(f)) && may_be_considered(f);
    if (!before->considered)
        return;
    before->seconds = f->motion.seconds;
    plr_motion_covariance_by_state(f, before->of_nu);
    whiten(L, before->of_nu);
    memcpy(before->bias, f->bias, sizeof before->bias);
    plr_covariance_get(f, PLR_BLOCK_BIAS, PLR_BLOCK_BIAS, before->P_bb);
    for (unsigned k = 0; k < PLR_CALIBRATIONS; k++)
        memcpy(before->S_b[k], f->S[k] + plr_row_of(f, PLR_BLOCK_BIAS), sizeof before->S_b[k]);
}

void plr_bias_restore(plr_filter *f, const plr_considered_bias *before) {
    plr_real lost[PLR_BIAS_DIM * PLR_BIAS_DIM];
    if (!before->considered)
        return;
    memcpy(f->bias, before->bias, sizeof before->bias);
    for (unsigned k = 0; k < PLR_CALIBRATIONS; k++)
        memcpy(f->S[k] + plr_row_of(f, PLR_BLOCK_BIAS), before->S_b[k], sizeof before->S_b[k]);
    plr_covariance_get(f, PLR_BLOCK_BIAS, PLR_BLOCK_BIAS, lost);
    for (unsigned i = 0; i < PLR_BIAS_DIM * PLR_BIAS_DIM; i++)
        lost[i] = before->P_bb[i] - lost[i];
    plr_covariance_add(f, PLR_BLOCK_BIAS, lost);
    plr_process_of(f)->walk(f, before->seconds);
}
