// SPDX-License-Identifier: MIT
/* Going on after the covariance has broken down: the pose is kept, what was tied to it is dropped. */
#include <string.h>

#include "filter/consistency.h"
#include "filter/covariance.h"
#include "filter/filter_internal.h"
#include "filter/motion.h"

void plr_filter_keep_for_recovery(plr_filter *f) {
    plr_real P[36];
    plr_covariance_pose(f, P);
    for (unsigned i = 0, at = 0; i < 6; i++)
        for (unsigned j = 0; j <= i; j++)
            f->recovery_P[at++] = P[6 * i + j];
}

void plr_filter_recover(plr_filter *f) {
    double P_xi[36], variance[6];
    f->count = 0;
    f->diverged = 0;
    f->totals.recoveries++;
    f->totals.widened++;
    f->frames_without_use = f->frames_mostly_gated = 0;
    f->work.noise.open = 0;
    for (unsigned i = 0, at = 0; i < 6; i++)
        for (unsigned j = 0; j <= i; j++, at++)
            P_xi[6 * i + j] = P_xi[6 * j + i] = (double)f->recovery_P[at];
    for (unsigned i = 0; i < 6; i++)
        P_xi[7 * i] += (double)f->motion.Q[7 * i];
    plr_motion_clear(&f->motion);
    plr_covariance_set_pose(f, P_xi);
    plr_consistency_clear(f);
    f->consistency.doubtful = 1;
    if (!f->config.bias)
        return;
    for (unsigned i = 0; i < 6; i++) {
        const plr_real sigma = f->bias_prior_sigma[i], off = f->bias[i] - f->bias_prior[i];
        if (!(off <= 4 * sigma && off >= -4 * sigma))
            f->bias[i] = f->bias_prior[i];
        variance[i] = (double)sigma * (double)sigma;
    }
    plr_covariance_set_bias(f, variance);
}
