// SPDX-License-Identifier: MIT
#include "filter/considered_bias.h"

#include <string.h>

#include "process/process.h"
#include "process/velocity.h"
#include "state/blocks.h"
#include "state/covariance.h"

/* Not with an IMU, whose biases, velocity and tilt are found together after a start in motion; nor
 * if another sensor has told of the biases since the last frame. */
static bool may_be_considered(const plr_filter *f) {
    return plr_has_block(&f->belief, PLR_BLOCK_BIAS) &&
           !plr_has_block(&f->belief, PLR_BLOCK_VELOCITY) && !plr_velocity_informs_bias(&f->source);
}

void plr_bias_consider(plr_filter *f, bool hold, plr_considered_bias *before) {
    before->considered = hold && may_be_considered(f);
    if (!before->considered)
        return;
    f->camera.estimate.moves = 0; /* nor is anything learnt of it */
    before->seconds = f->motion.seconds;
    memcpy(before->bias, f->belief.bias, sizeof before->bias);
    plr_covariance_get(&f->belief, PLR_BLOCK_BIAS, PLR_BLOCK_BIAS, before->P_bb);
    for (unsigned k = 0; k < f->camera.errors.count; k++)
        memcpy(before->S_b[k], f->belief.S[k] + plr_row_of(&f->belief, PLR_BLOCK_BIAS),
               sizeof before->S_b[k]);
}

void plr_bias_restore(plr_filter *f, const plr_considered_bias *before) {
    plr_real lost[PLR_BIAS_DIM * PLR_BIAS_DIM];
    if (!before->considered)
        return;
    memcpy(f->belief.bias, before->bias, sizeof before->bias);
    for (unsigned k = 0; k < f->camera.errors.count; k++)
        memcpy(f->belief.S[k] + plr_row_of(&f->belief, PLR_BLOCK_BIAS), before->S_b[k],
               sizeof before->S_b[k]);
    plr_covariance_get(&f->belief, PLR_BLOCK_BIAS, PLR_BLOCK_BIAS, lost);
    for (unsigned i = 0; i < PLR_BIAS_DIM * PLR_BIAS_DIM; i++)
        lost[i] = before->P_bb[i] - lost[i];
    plr_covariance_add(&f->belief, PLR_BLOCK_BIAS, lost);
    plr_process_walk(&f->belief, &f->source, before->seconds);
}
