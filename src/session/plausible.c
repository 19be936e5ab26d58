// SPDX-License-Identifier: MIT
#include "session/plausible.h"

static const double SPEED_MPS = 1e4, RATE_RADPS = 1e3, POSITION_M = 1e9, VARIANCE = 1e12;

static bool is_finite(double x) {
    return x - x == 0;
}

bool plr_plausible_finite(const double *x, unsigned n) {
    while (n > 0 && is_finite(x[n - 1]))
        n--;
    return n == 0;
}

static bool all_within(const double *x, unsigned n, double limit) {
    for (unsigned i = 0; i < n; i++)
        if (is_finite(x[i]) && (x[i] > limit || x[i] < -limit))
            return false;
    return true;
}

bool plr_plausible_pose(const plr_pose *pose) {
    return all_within(pose->p, 3, POSITION_M);
}

bool plr_plausible_bias(const plr_start *start) {
    return all_within(start->bias, 3, SPEED_MPS) && all_within(start->bias + 3, 3, RATE_RADPS) &&
           all_within(start->bias_variance, 6, VARIANCE);
}

bool plr_plausible_variance(const double *variance, unsigned n) {
    return all_within(variance, n, VARIANCE);
}

bool plr_plausible_message(const plr_message *message) {
    const plr_twist *twist = &message->as.twist.twist;
    const plr_start *start = &message->as.start;
    const plr_landmark *landmark = &message->as.landmark.landmark;
    const plr_reading *reading = &message->as.reading;
    switch (message->kind) {
    case PLR_KIND_TWIST:
        return all_within(twist->v_B_mps, 3, SPEED_MPS) &&
               all_within(twist->w_B_radps, 3, RATE_RADPS);
    case PLR_KIND_START:
        return plr_plausible_pose(&start->T_WB) &&
               (!start->has_covariance || all_within(start->P_xi, 21, VARIANCE));
    case PLR_KIND_LANDMARK:
        return all_within(landmark->p_W_m, 3, POSITION_M) &&
               all_within(landmark->P_W_m2, 9, VARIANCE);
    case PLR_KIND_READING:
        return all_within(reading->value, 3, POSITION_M);
    default:
        return true;
    }
}
