// SPDX-License-Identifier: MIT
/* Init, reset, and poses, biases and motions set by the caller. */
#include "pelorus/filter.h"

#include <string.h>

#include "filter/extrinsics.h"
#include "filter/filter_internal.h"
#include "filter/guard.h"
#include "filter/predict.h"
#include "math/finite.h"
#include "math/se3.h"
#include "math/small.h"
#include "math/so3.h"
#include "process/alignment.h"
#include "process/process.h"
#include "process/velocity.h"
#include "state/blocks.h"
#include "state/calibration.h"
#include "state/covariance.h"
#include "state/motion.h"
#include "supervise/supervise.h"

/* ---------------------------------------------------------------- init */

/* The bits of a result depend on subnormals: a processor that flushes them computes others. */
static bool keeps_subnormals(void) {
    volatile plr_real tiny = PLR_SMALLEST_NORMAL;
    volatile plr_real half = tiny * PLR_R(0.5);
    return half > 0;
}

static bool is_calibration(const plr_calibration *c) {
    static const double smallest = 1e-6, largest = 1e6; /* px and m, of any camera */
    const double positive[3] = {c->fx_px, c->fy_px, c->baseline_m};
    const double centre[2] = {c->cx_px, c->cy_px};
    for (int i = 0; i < 3; i++)
        if (!(positive[i] >= smallest))
            return false;
    return plr_all_within(positive, 3, largest) && plr_all_within(centre, 2, largest) &&
           plr_all_within(c->T_CB.p, 3, largest) && plr_is_rotation(c->T_CB.R);
}

static void set_camera(plr_camera *camera, const plr_calibration *c) {
    camera->fx = (plr_real)c->fx_px;
    camera->fy = (plr_real)c->fy_px;
    camera->cx = (plr_real)c->cx_px;
    camera->cy = (plr_real)c->cy_px;
    camera->baseline = (plr_real)c->baseline_m;
    for (int i = 0; i < 9; i++)
        camera->R_CB[i] = (plr_real)c->T_CB.R[i];
    for (int i = 0; i < 3; i++)
        camera->t_CB[i] = (plr_real)c->T_CB.p[i];
    plr_so3_orthonormalise(camera->R_CB);
}

static plr_real squared(double x) {
    return (plr_real)(x * x);
}

static void set_camera_model(plr_camera_model *camera, const plr_calibration *calibration,
                             const plr_config *c) {
    set_camera(&camera->given, calibration);
    camera->pixel_variance = squared(c->pixel_sigma_px);
    camera->track_drift_variance = squared(c->track_drift_px);
    camera->min_disparity = (plr_real)c->min_disparity_px;
    camera->max_row_gap = (plr_real)c->max_row_gap_px;
    camera->min_depth = (plr_real)c->min_depth_m;
    camera->max_depth = (plr_real)c->max_depth_m;
    camera->min_inverse_range = (plr_real)(1 / c->max_range_m);
    camera->landmark_variance = squared(c->landmark_sigma_m);
    camera->landmark_prior = c->landmark_prior;
    plr_calibration_lay_out(&camera->errors, c);
}

static void set_source(plr_source *source, const plr_config *c) {
    for (int i = 0; i < 3; i++) {
        source->velocity_variance[i] = squared(c->velocity_sigma[i]);
        source->gyro_variance[i] = squared(c->gyro_sigma[i]);
    }
    source->bias_velocity_walk = (plr_real)c->bias_velocity_walk;
    source->bias_gyro_walk = (plr_real)c->bias_gyro_walk;
    source->gravity = (plr_real)c->gravity_mps2;
    source->accel_density = squared(c->accel_noise);
    source->gyro_density = squared(c->gyro_noise);
    source->accel_walk_variance = squared(c->accel_walk);
    source->gyro_walk_variance = squared(c->gyro_walk);
    source->start_velocity_variance = squared(c->start_velocity_sigma_mps);
    source->gate_d2 = (plr_real)c->gate_d2;
    source->process = c->process;
    source->timing = c->process == PLR_PROCESS_IMU ? c->imu_timing : c->twist_timing;
    source->noise = c->noise;
    source->poses_are_given = c->mode == PLR_MODE_MAPPING;
}

/* All that init derives from settings and calibration. */
static void set_constants(plr_filter *f, const plr_calibration *calibration, const plr_config *c) {
    f->par.gate_d2 = (plr_real)c->gate_d2;
    f->par.gate_residual2 = squared(c->gate_residual_px);
    f->par.max_gap_ns = (plr_time_ns)(c->max_gap_s * 1e9);
    set_camera_model(&f->camera, calibration, c);
    set_source(&f->source, c);
    f->belief.model = c->model;
    f->belief.capacity = c->slots;
    f->belief.layout.errors = f->camera.errors.count;
    plr_extrinsics_set(f, c);
    plr_se3_adjoint(f->camera.Ad_CB, f->camera.given.R_CB, f->camera.given.t_CB);
}

plr_status plr_filter_init_sized(plr_filter *f, const plr_calibration *calibration,
                                 const plr_config *config, const plr_map *map,
                                 const plr_sizes *caller) {
    const plr_sizes here = plr_sizes_here(sizeof(plr_filter));
    if (!f || !caller)
        return PLR_E_ARGUMENT;
    if (!plr_sizes_agree(caller, &here))
        return PLR_E_SIZE;
    f->magic = 0;
    if (!calibration || !config)
        return PLR_E_ARGUMENT;
    if (plr_config_check(config, NULL) != PLR_OK)
        return PLR_E_CONFIG;
    if (!is_calibration(calibration))
        return PLR_E_CALIBRATION;
    if (config->mode == PLR_MODE_LOCALIZATION && (!map || !map->source))
        return PLR_E_MODE;
    if (!keeps_subnormals())
        return PLR_E_CPU;

    memset(f, 0, sizeof *f);
    f->config = *config;
    if (map)
        f->map = *map;
    set_constants(f, calibration, config);
    plr_process_of(&f->source)->lay_out(&f->belief, &f->config);
    f->magic = PLR_FILTER_MAGIC;
    plr_guard_seal_constant(f);
    return plr_filter_reset(f);
}

/* P_xi = start_sigma^2 I, or zero where poses are given exactly. */
static void start_covariance(const plr_filter *f, double P_xi[PLR_POSE_SQUARE]) {
    const double sigma = f->config.mode == PLR_MODE_MAPPING ? 0 : f->config.start_sigma;
    memset(P_xi, 0, PLR_POSE_SQUARE * sizeof *P_xi);
    for (int i = 0; i < PLR_POSE_DIM; i++)
        P_xi[(PLR_POSE_DIM + 1) * i] = sigma * sigma;
}

static void set_bias_prior(plr_filter *f, const double mean[PLR_POSE_DIM],
                           const double variance[PLR_POSE_DIM]) {
    for (int i = 0; i < PLR_POSE_DIM; i++) {
        f->belief.bias[i] = f->source.bias_prior[i] = (plr_real)mean[i];
        f->source.bias_prior_sigma[i] = PLR_SQRT((plr_real)variance[i]);
    }
    f->source.bias_walked_s = 0;
    plr_filter_begin_bias(f, variance);
}

static void start_bias(plr_filter *f) {
    static const double zero[PLR_POSE_DIM] = {0};
    double variance[PLR_POSE_DIM] = {0};
    if (f->config.mode != PLR_MODE_MAPPING)
        for (unsigned i = 0; i < PLR_POSE_DIM; i++)
            variance[i] = plr_filter_bias_variance(&f->config, i);
    set_bias_prior(f, zero, variance);
}

plr_status plr_filter_reset(plr_filter *f) {
    double P_xi[PLR_POSE_SQUARE];
    const plr_status sound = plr_guard_check_constant(f);
    if (sound != PLR_OK)
        return sound;
    f->belief.t_ns = f->source.reading_ns = 0;
    f->source.interval_s = 0;
    f->clock_started = f->source.reading_valid = 0;
    memset(f->source.reading, 0, sizeof f->source.reading);
    memset(f->belief.bias, 0, sizeof f->belief.bias);
    memset(f->belief.velocity, 0, sizeof f->belief.velocity);
    memset(f->belief.p_WB, 0, sizeof f->belief.p_WB);
    memset(&f->totals, 0, sizeof f->totals);
    plr_mat3_identity(f->belief.R_WB);
    memset(&f->motion.core, 0, sizeof f->motion.core);
    plr_calibration_reset(&f->camera);
    plr_motion_clear(&f->belief, &f->motion);
    plr_velocity_forget(&f->source);
    plr_alignment_clear(&f->source);
    memset(&f->source.wheels, 0, sizeof f->source.wheels);
    f->belief.count = 0;
    f->belief.frame_number = 0;
    f->frames_off_the_map = 0;
    plr_supervise_begin(&f->supervisor, &f->config);
    memset(f->source.bias_prior, 0, sizeof f->source.bias_prior);
    f->source.bias_walked_s = 0;
    start_covariance(f, P_xi);
    plr_covariance_begin(&f->belief, PLR_BLOCK_POSE, P_xi);
    plr_filter_store_for_recovery(f);
    plr_filter_begin_velocity(f);
    if (plr_has_block(&f->belief, PLR_BLOCK_BIAS))
        start_bias(f);
    plr_guard_seal_whole(f);
    return PLR_OK;
}

/* ---------------------------------------------------------------- set by the caller */

void plr_filter_forget_reading(plr_filter *f) {
    plr_velocity_forget(&f->source);
    f->source.reading_valid = 0;
    f->source.unused = 0;
    f->source.interval_s = 0;
    plr_process_of(&f->source)->rest(&f->belief, &f->source, f->source.reading);
}

static plr_status check_pose(const plr_pose *T_WB) {
    if (!plr_all_finite(T_WB->R, 9) || !plr_all_finite(T_WB->p, 3))
        return PLR_E_NOT_FINITE;
    if (!plr_is_rotation(T_WB->R))
        return PLR_E_ARGUMENT;
    return plr_all_within(T_WB->p, 3, PLR_MAX_POSITION) ? PLR_OK : PLR_E_RANGE;
}

static void get_rotation(plr_real R[9], const plr_pose *T_WB) {
    for (int i = 0; i < 9; i++)
        R[i] = (plr_real)T_WB->R[i];
    plr_so3_orthonormalise(R);
}

static void store_pose(plr_filter *f, plr_time_ns t_ns, const plr_pose *T_WB) {
    get_rotation(f->belief.R_WB, T_WB);
    memcpy(f->belief.p_WB, T_WB->p, sizeof f->belief.p_WB);
    f->belief.t_ns = t_ns;
    f->clock_started = 1;
    f->source.unused = 0;
}

plr_status plr_filter_set_pose(plr_filter *f, plr_time_ns t_ns, const plr_pose *T_WB,
                               const double *P_xi) {
    const plr_status sound = T_WB ? plr_guard_check_whole(f) : PLR_E_ARGUMENT;
    if (sound != PLR_OK)
        return sound;
    if (f->config.mode == PLR_MODE_MAPPING)
        return plr_filter_refuse(f, PLR_E_MODE);
    const plr_status status = check_pose(T_WB);
    if (status != PLR_OK)
        return plr_filter_refuse(f, status);
    if (P_xi && !plr_all_finite(P_xi, PLR_POSE_SQUARE))
        return plr_filter_refuse(f, PLR_E_NOT_FINITE);
    if (P_xi && !plr_all_within(P_xi, PLR_POSE_SQUARE, PLR_MAX_VARIANCE))
        return plr_filter_refuse(f, PLR_E_RANGE);
    if (P_xi && !plr_is_covariance(P_xi, PLR_POSE_DIM))
        return plr_filter_refuse(f, PLR_E_ARGUMENT);

    plr_pose at = *T_WB;
    double P_start[PLR_POSE_SQUARE];
    start_covariance(f, P_start);
    if (P_xi)
        memcpy(P_start, P_xi, sizeof P_start);
    plr_extrinsics_pose_in(f, &at);
    plr_extrinsics_covariance_in(f, P_start);
    plr_predict_drop(f);
    plr_alignment_follow_clock(&f->belief, &f->source, t_ns);
    if (f->clock_started)
        f->totals.resets++;
    f->belief.count = 0;
    plr_covariance_begin(&f->belief, PLR_BLOCK_POSE, P_start);
    store_pose(f, t_ns, &at);
    f->source.inertial.pose_given = 1;
    if (P_xi)
        plr_alignment_keep_world(&f->source);
    plr_supervise_pose_set(&f->supervisor);
    plr_filter_store_for_recovery(f);
    f->frames_off_the_map = 0;
    if (!plr_covariance_is_positive(&f->belief)) /* the biases are lost too */
        plr_filter_begin_prior_bias(f, 0);
    /* readings and frames of another clock are not used any more */
    if (f->source.reading_ns > t_ns || t_ns - f->source.reading_ns > f->par.max_gap_ns)
        plr_filter_forget_reading(f);
    plr_supervise_clock_set_to(&f->supervisor, t_ns, f->par.max_gap_ns);
    plr_guard_seal_whole(f);
    return PLR_OK;
}

plr_status plr_filter_set_bias(plr_filter *f, const double *mean, const double *variance) {
    const plr_status sound = mean && variance ? plr_guard_check_whole(f) : PLR_E_ARGUMENT;
    if (sound != PLR_OK)
        return sound;
    if (!plr_has_block(&f->belief, PLR_BLOCK_BIAS) || f->totals.twists > 0 ||
        f->totals.frames > 0 || f->config.mode == PLR_MODE_MAPPING)
        return plr_filter_refuse(f, PLR_E_MODE);
    if (!plr_all_finite(mean, PLR_POSE_DIM) || !plr_all_finite(variance, PLR_POSE_DIM))
        return plr_filter_refuse(f, PLR_E_NOT_FINITE);
    if (!plr_all_within(mean, PLR_POSE_DIM, PLR_MAX_BIAS) ||
        !plr_all_within(variance, PLR_POSE_DIM, PLR_MAX_VARIANCE))
        return plr_filter_refuse(f, PLR_E_RANGE);
    for (int i = 0; i < PLR_POSE_DIM; i++)
        if (variance[i] < 0)
            return plr_filter_refuse(f, PLR_E_ARGUMENT);
    set_bias_prior(f, mean, variance);
    plr_filter_forget_reading(f);
    plr_guard_seal_whole(f);
    return PLR_OK;
}

plr_status plr_filter_move_to(plr_filter *f, plr_time_ns t_ns, const plr_pose *T_WB) {
    const plr_status sound = T_WB ? plr_guard_check(f) : PLR_E_ARGUMENT;
    if (sound != PLR_OK)
        return sound;
    if (f->config.mode != PLR_MODE_MAPPING)
        return plr_filter_refuse(f, PLR_E_MODE);
    const plr_status status = check_pose(T_WB);
    if (status != PLR_OK)
        return plr_filter_refuse(f, status);
    if (f->clock_started && t_ns <= f->belief.t_ns)
        return plr_filter_refuse(f, PLR_E_TIME);
    plr_pose at = *T_WB;
    plr_extrinsics_pose_in(f, &at);
    if (!f->clock_started) {
        store_pose(f, t_ns, &at);
        plr_guard_seal(f);
        return PLR_OK;
    }
    plr_real R[9];
    get_rotation(R, &at);
    plr_motion_jump(&f->belief, &f->motion, t_ns, R, at.p);
    plr_guard_seal(f);
    return PLR_OK;
}

/* ---------------------------------------------------------------- evidence */

plr_readings_evidence plr_filter_readings_at(const plr_filter *f, plr_time_ns now_ns) {
    const bool imu = f->config.process == PLR_PROCESS_IMU;
    const plr_imu_fault fault = (plr_imu_fault)f->source.inertial.fault;
    return (plr_readings_evidence){.now_ns = now_ns,
                                   .reading_ns = f->source.reading_ns,
                                   .interval_s = f->source.interval_s,
                                   .valid = f->source.reading_valid,
                                   .needed = f->config.mode != PLR_MODE_MAPPING,
                                   .looks = f->config.mode != PLR_MODE_DEAD_RECKONING,
                                   .imu = imu,
                                   .started = !imu || f->source.inertial.phase >= PLR_IMU_UNSETTLED,
                                   .unsettled = imu && plr_alignment_is_unsettled(&f->source),
                                   .fault_of_start = fault > PLR_IMU_FAULT_MOVES &&
                                                     fault < PLR_IMU_FAULT_SATURATED,
                                   .fault_of_reading = fault >= PLR_IMU_FAULT_SATURATED,
                                   .refused = f->totals.twists_refused};
}

void plr_filter_pending_motion(const plr_filter *f, plr_picture_evidence *e) {
    const plr_motion *m = &f->motion;
    plr_real turn[3];
    plr_turn_of(turn, m->E);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        e->moved[k] = k < 3 ? m->p[k] : turn[k - 3];
        e->variance[k] = m->Q[(PLR_POSE_DIM + 1) * k];
    }
}

void plr_filter_note_motion(plr_filter *f) {
    plr_picture_evidence pending = {0};
    if (!f->motion.pending)
        return;
    plr_filter_pending_motion(f, &pending);
    plr_supervise_moved(&f->supervisor, &pending);
}

plr_status plr_filter_health(const plr_filter *f, plr_time_ns t_ns, plr_health_state *health) {
    if (!f || !health)
        return PLR_E_ARGUMENT;
    memset(health, 0, sizeof *health);
    const plr_status sound = plr_guard_check(f);
    if (sound != PLR_OK) {
        health->health = PLR_HEALTH_DIVERGED;
        health->reasons = sound == PLR_E_DAMAGED ? PLR_REASON_STATE_DAMAGED : 0;
        return sound;
    }
    const plr_readings_evidence now =
        plr_filter_readings_at(f, t_ns > f->belief.t_ns ? t_ns : f->belief.t_ns);
    plr_supervise_health(&f->supervisor, &now, health);
    health->resets = f->totals.resets + f->totals.widened;
    return PLR_OK;
}
