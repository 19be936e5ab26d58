// SPDX-License-Identifier: MIT
#include "filter/guard.h"

#include <string.h>

#include "filter/filter_internal.h"
#include "math/checksum.h"
#include "math/finite.h"
#include "math/small.h"
#include "state/covariance.h"
#include "state/polar.h"

enum { HEAD = (PLR_POSE_DIM + PLR_BIAS_DIM) * (PLR_POSE_DIM + PLR_BIAS_DIM + 1) / 2 };

/* ---------------------------------------------------------------- sums */

/* Members of the filter: from the beginning of one to that of another behind it. */
#define ADD_BETWEEN(sum, f, from, to)                                                              \
    plr_checksum_add((sum), (const unsigned char *)(f) + offsetof(plr_filter, from),               \
                     offsetof(plr_filter, to) - offsetof(plr_filter, from))

static uint64_t constant_sum(const plr_filter *f) {
    plr_checksum sum = plr_checksum_begin;
    ADD_BETWEEN(&sum, f, config, camera.estimate);
    ADD_BETWEEN(&sum, f, source, source.alignment);
    ADD_BETWEEN(&sum, f, belief, belief.count);
    return plr_checksum_mixed(&sum);
}

static uint64_t moving_sum(const plr_filter *f) {
    plr_checksum sum = plr_checksum_begin;
    ADD_BETWEEN(&sum, f, camera.estimate.rate, source);
    ADD_BETWEEN(&sum, f, source.reading_ns, belief.slots);
    ADD_BETWEEN(&sum, f, frames_off_the_map, guard);
    if (f->config.process == PLR_PROCESS_IMU && f->source.inertial.phase < PLR_IMU_UNSETTLED)
        plr_checksum_add(&sum, &f->source.alignment, sizeof f->source.alignment);
    if (f->source.velocities_known)
        plr_checksum_add(&sum, &f->source.velocities, sizeof f->source.velocities);
    if (f->source.wheels.count > 0)
        plr_checksum_add(&sum, &f->source.wheels, sizeof f->source.wheels);
    return plr_checksum_mixed(&sum);
}

static uint64_t told_sum(const plr_filter *f) {
    const size_t used = plr_covariance_size(&f->belief, f->belief.count);
    plr_checksum sum = plr_checksum_begin;
    ADD_BETWEEN(&sum, f, camera.estimate, camera.estimate.rate);
    plr_checksum_add(&sum, plr_covariance_elements(&f->belief),
                     (used < HEAD ? used : HEAD) * sizeof(plr_real));
    return plr_checksum_mixed(&sum);
}

static uint64_t large_sum(const plr_filter *f) {
    plr_checksum sum = plr_checksum_begin;
    plr_checksum_add(&sum, f->belief.slots, f->belief.count * sizeof *f->belief.slots);
    ADD_BETWEEN(&sum, f, supervisor, frames_off_the_map);
    plr_checksum_add(&sum, plr_covariance_elements(&f->belief),
                     plr_covariance_size(&f->belief, f->belief.count) * sizeof(plr_real));
    for (unsigned k = 0; k < f->camera.errors.count; k++)
        plr_checksum_add(&sum, f->belief.S[k],
                         plr_covariance_dim(&f->belief) * sizeof *f->belief.S[k]);
    plr_checksum_add(&sum, &f->belief.held, sizeof f->belief.held);
    return plr_checksum_mixed(&sum);
}

/* ---------------------------------------------------------------- ranges */

/* Counts and choices are in their ranges: no index can leave its array. */
static bool is_in_range(const plr_filter *f) {
    const plr_config *c = &f->config;
    return c->model <= PLR_MODEL_WORLD && f->belief.model == c->model &&
           c->mode <= PLR_MODE_DEAD_RECKONING && c->twist_timing <= PLR_TWIST_MID &&
           c->noise <= PLR_NOISE_STEP && c->process <= PLR_PROCESS_IMU &&
           c->imu_start <= PLR_IMU_START_GIVEN && c->imu_timing <= PLR_TWIST_MID && c->bias <= 1 &&
           c->known_map <= 1 && c->scene <= PLR_SCENE_MAY_MOVE &&
           c->landmark_prior <= PLR_PRIOR_INDEPENDENT && c->slots >= 1 &&
           c->slots <= PLR_MAX_LANDMARKS && f->belief.count <= c->slots && f->clock_started <= 1 &&
           f->source.reading_valid <= 1 && f->source.wheels.count <= PLR_WHEELS &&
           f->motion.pending <= 1 && f->motion.noisy <= 1;
}

bool plr_guard_is_pose(const plr_real R_WB[9], const double p_WB[3]) {
    const plr_real allowed = PLR_R(1e-3);
    const plr_real *R = R_WB;
    plr_real third[3];
    if (!plr_all_finite(p_WB, 3))
        return false;
    for (unsigned i = 0; i < 3; i++) {
        for (unsigned j = 0; j <= i; j++) {
            const plr_real dot = R[i] * R[j] + R[3 + i] * R[3 + j] + R[6 + i] * R[6 + j];
            const plr_real off = dot - (i == j ? PLR_R(1) : PLR_R(0));
            if (!(off <= allowed && off >= -allowed))
                return false;
        }
    }
    plr_cross3(third, R, R + 3);
    return plr_dot3(third, R + 6) > 0;
}

bool plr_guard_is_landmark(const plr_filter *f, const plr_slot *slot) {
    const plr_real range2 = plr_dot3(slot->x, slot->x);
    const plr_real least =
        f->belief.model == PLR_MODEL_BODY ? PLR_R(0.5) * PLR_MIN_RANGE : PLR_R(0);
    return range2 >= least * least && plr_is_finite(range2);
}

/* ---------------------------------------------------------------- checks and seals */

plr_status plr_guard_check_constant(const plr_filter *f) {
    if (!f)
        return PLR_E_ARGUMENT;
    if (f->magic != PLR_FILTER_MAGIC)
        return PLR_E_NOT_READY;
    return constant_sum(f) == f->guard.constant ? PLR_OK : PLR_E_DAMAGED;
}

static plr_status check_moving(const plr_filter *f) {
    const plr_status status = plr_guard_check_constant(f);
    if (status != PLR_OK)
        return status;
    const bool sound = is_in_range(f) && plr_guard_is_pose(f->belief.R_WB, f->belief.p_WB) &&
                       moving_sum(f) == f->guard.moving;
    return sound ? PLR_OK : PLR_E_DAMAGED;
}

plr_status plr_guard_check(const plr_filter *f) {
    const plr_status status = check_moving(f);
    return status == PLR_OK && told_sum(f) != f->guard.told ? PLR_E_DAMAGED : status;
}

plr_status plr_guard_check_reading(const plr_filter *f) {
    const plr_status status = check_moving(f);
    if (status != PLR_OK)
        return status;
    const bool imu = f->config.process == PLR_PROCESS_IMU;
    const bool uses_told =
        imu ? f->source.inertial.phase < PLR_IMU_UNSETTLED : f->source.velocities_known;
    return uses_told && told_sum(f) != f->guard.told ? PLR_E_DAMAGED : PLR_OK;
}

plr_status plr_guard_check_whole(const plr_filter *f) {
    const plr_status status = plr_guard_check(f);
    return status == PLR_OK && large_sum(f) != f->guard.large ? PLR_E_DAMAGED : status;
}

void plr_guard_seal(plr_filter *f) {
    f->guard.moving = moving_sum(f);
}

void plr_guard_seal_whole(plr_filter *f) {
    f->guard.large = large_sum(f);
    f->guard.told = told_sum(f);
    plr_guard_seal(f);
}

void plr_guard_seal_constant(plr_filter *f) {
    f->guard.constant = constant_sum(f);
}

plr_status plr_filter_refuse(plr_filter *f, plr_status status) {
    if (status == PLR_E_LATE)
        f->totals.late++;
    else
        f->totals.refused++;
    plr_guard_seal(f);
    return status;
}
