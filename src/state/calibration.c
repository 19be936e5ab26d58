// SPDX-License-Identifier: MIT
#include "state/calibration.h"

#include <string.h>

#include "math/dense.h"
#include "math/finite.h"
#include "math/se3.h"
#include "math/small.h"
#include "math/so3.h"
#include "pelorus/assertions.h"
#include "state/blocks.h"
#include "state/camera.h"
#include "state/pose.h"

enum {
    K = PLR_CALIBRATIONS,
    USUAL_AT_FIRST = 20, /* frames that the prior of what is usual counts */
    MOST_MISFITS = 10    /* frames that would move a number too far, until it is refused */
};

/* ---------------------------------------------------------------- the columns */

static plr_real squared(double x) {
    return (plr_real)(x * x);
}

static void fill_variances(const plr_config *c, plr_real variance[PLR_CALIBRATION_ERRORS]) {
    variance[PLR_BASELINE] = squared(c->baseline_sigma);
    variance[PLR_FOCAL_LENGTH] = squared(c->focal_sigma);
    for (unsigned axis = 0; axis < 3; axis++) {
        variance[PLR_CAMERA_TURN_X + axis] = squared(c->camera_turn_sigma_rad);
        variance[PLR_CAMERA_PLACE_X + axis] = squared(c->camera_place_sigma_m);
    }
    variance[PLR_CENTRE_X] = variance[PLR_CENTRE_Y] = squared(c->centre_sigma_px);
    variance[PLR_CAMERA_CLOCK] = squared(c->camera_clock_sigma_s);
    variance[PLR_WHEEL_SCALE] = squared(c->wheel_scale_sigma);
    variance[PLR_WHEEL_TRACK] = squared(c->wheel_track_sigma);
}

/* The part of the calibration, and so of the setting calibrate, that an error belongs to. */
static const uint8_t part_of[PLR_CALIBRATION_ERRORS] = {
    [PLR_BASELINE] = PLR_CALIBRATE_BASELINE,       [PLR_FOCAL_LENGTH] = PLR_CALIBRATE_FOCAL,
    [PLR_CAMERA_TURN_X] = PLR_CALIBRATE_TURN,      [PLR_CAMERA_TURN_Y] = PLR_CALIBRATE_TURN,
    [PLR_CAMERA_TURN_Z] = PLR_CALIBRATE_TURN,      [PLR_CENTRE_X] = PLR_CALIBRATE_CENTRE,
    [PLR_CENTRE_Y] = PLR_CALIBRATE_CENTRE,         [PLR_CAMERA_PLACE_X] = PLR_CALIBRATE_PLACE,
    [PLR_CAMERA_PLACE_Y] = PLR_CALIBRATE_PLACE,    [PLR_CAMERA_PLACE_Z] = PLR_CALIBRATE_PLACE,
    [PLR_CAMERA_CLOCK] = PLR_CALIBRATE_CLOCK,      [PLR_WHEEL_SCALE] = PLR_CALIBRATE_WHEEL_SCALE,
    [PLR_WHEEL_TRACK] = PLR_CALIBRATE_WHEEL_TRACK,
};

void plr_calibration_lay_out(plr_error_columns *to, const plr_config *config) {
    plr_real variance[PLR_CALIBRATION_ERRORS];
    fill_variances(config, variance);
    memset(to, 0, sizeof *to);
    for (unsigned considered = 0; considered < 2; considered++) {
        for (unsigned kind = 0; kind < PLR_CALIBRATION_ERRORS; kind++) {
            const bool listed = (config->calibrate & part_of[kind]) != 0;
            if (listed == (considered != 0) || !(variance[kind] > 0) || to->count == K)
                continue;
            to->kind[to->count] = (uint8_t)kind;
            to->variance[to->count++] = variance[kind];
        }
        if (!considered)
            to->estimated = to->count;
    }
}

/* ---------------------------------------------------------------- the camera */

/* The column of the camera's clock, or count. */
static unsigned column_of_clock(const plr_camera_model *camera) {
    return plr_calibration_column(&camera->errors, PLR_CAMERA_CLOCK);
}

/* By how much later than its stamp a picture was taken, s. */
static plr_real offset_of_clock(const plr_camera_model *camera) {
    return plr_calibration_moved(camera, PLR_CAMERA_CLOCK);
}

/* By its clock the camera was elsewhere: q(t + tau) = Exp(-tau u) q(t), u its mean twist over tau. */
static void place_eye(plr_camera_model *camera) {
    plr_camera_estimate *c = &camera->estimate;
    plr_real way[PLR_POSE_DIM], R[9], p[3], turned[3];
    const plr_real tau = offset_of_clock(camera);
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        way[i] = -tau * c->mean_twist[i];
    plr_se3_exp(R, p, way);
    plr_mat3_mul(c->eye.R_CB, c->R, R);
    plr_mat3_vec(turned, c->R, p);
    for (unsigned i = 0; i < 3; i++)
        c->eye.t_CB[i] = c->t[i] + turned[i];
}

void plr_calibration_place(const plr_camera_model *camera, plr_real R[9], plr_real t[3]) {
    const plr_camera *eye = &camera->estimate.eye;
    plr_mat3_mul(R, eye->R_CB, camera->given.R_CB);
    plr_camera_from_body(t, eye, camera->given.t_CB);
}

void plr_calibration_forget(plr_camera_model *camera) {
    plr_camera_estimate *c = &camera->estimate;
    memset(c->factor, 0, sizeof c->factor);
    memset(c->sum, 0, sizeof c->sum);
    memset(c->sum_variance, 0, sizeof c->sum_variance);
    c->usual_frames = USUAL_AT_FIRST;
    c->excess = 1;
    for (unsigned k = 0; k < K; k++) {
        c->factor[(K + 1) * k] = c->told[k] = c->usual[k] = 1;
    }
}

void plr_calibration_put_back(plr_camera_model *camera) {
    plr_camera_estimate *c = &camera->estimate;
    memset(c->moved, 0, sizeof c->moved);
    memset(c->t, 0, sizeof c->t);
    c->eye = camera->given;
    plr_mat3_identity(c->R);
    place_eye(camera);
}

void plr_calibration_reset(plr_camera_model *camera) {
    memset(&camera->estimate, 0, sizeof camera->estimate);
    plr_calibration_forget(camera);
    plr_calibration_put_back(camera);
}

bool plr_calibration_refuses(const plr_camera_model *camera, unsigned k) {
    PLR_ASSERT(k < PLR_CALIBRATIONS);
    return camera->estimate.misfits[k] >= MOST_MISFITS;
}

bool plr_calibration_is_off(const plr_camera_model *camera) {
    for (unsigned k = 0; k < plr_calibration_estimated(&camera->errors); k++)
        if (plr_calibration_refuses(camera, k))
            return true;
    return false;
}

void plr_calibration_doubt(plr_camera_model *camera) {
    if (plr_calibration_is_off(camera))
        plr_calibration_reset(camera);
    else
        plr_calibration_forget(camera);
}

/* The gain of a Kalman filter in its steady state: the rate walks by so much in a step that it scatters in
 * half a second (a quarter in the mean) as it does beside the readings' noise. At least that of the mean of
 * half a second, at most that of a twentieth: a column that is late by so much is hardly less like the rate, but
 * its noise is in the innovations too, and draws the clock's offset towards zero. */
static plr_real rate_gain(const plr_inertial *s) {
    const plr_real noise = PLR_R(0.5) * s->change2[1], scatter = s->spread2[1] - noise;
    const plr_real least = PLR_R(2) * s->usual_s, most = PLR_R(20) * s->usual_s;
    if (!(noise > 0) || !(scatter > 0))
        return least;
    const plr_real walk = scatter / noise * s->usual_s / PLR_R(0.25);
    const plr_real gain = PLR_R(0.5) * (PLR_SQRT(PLR_FMA(walk, walk, PLR_R(4) * walk)) - walk);
    return gain < least ? least : gain > most && most < PLR_R(1) ? most : gain;
}

void plr_calibration_note_rate(plr_camera_model *camera, const plr_source *source,
                               const plr_real w_B[3]) {
    plr_camera_estimate *c = &camera->estimate;
    const plr_real gain = rate_gain(&source->inertial), left = PLR_R(1) - gain;
    const plr_real noise = PLR_R(0.5) * source->inertial.change2[1];
    if (source->inertial.phase < PLR_IMU_UNSETTLED) {
        memcpy(c->rate, source->inertial.slow + 3, sizeof c->rate);
        c->rate_variance = noise * PLR_R(2) * source->inertial.usual_s;
        return;
    }
    c->rate_variance = PLR_FMA(gain * gain, noise, left * left * c->rate_variance);
    for (unsigned i = 0; i < 3; i++)
        c->rate[i] = PLR_FMA(gain, w_B[i] - c->rate[i], c->rate[i]);
}

void plr_calibration_note_step(plr_camera_model *camera, const plr_real reading[PLR_POSE_DIM],
                               plr_real seconds) {
    plr_camera_estimate *c = &camera->estimate;
    if (column_of_clock(camera) == camera->errors.count)
        return;
    memmove(c->step + 1, c->step, sizeof c->step - sizeof c->step[0]);
    c->step[0][0] = seconds;
    memcpy(c->step[0] + 1, reading + 3, 3 * sizeof *reading);
}

bool plr_calibration_needs_twist(const plr_camera_model *camera) {
    return plr_calibration_estimated(&camera->errors) > 0 ||
           column_of_clock(camera) < camera->errors.count;
}

/* x <- 0, and false, unless it is beyond three sigmas, three numbers whose variances add up to that. */
static bool demand_motion(plr_real x[3], plr_real variance) {
    const bool moves = plr_dot3(x, x) > PLR_R(9) * variance;
    for (unsigned i = 0; i < 3 && !moves; i++)
        x[i] = 0;
    return moves;
}

/* mean += share times the mean rate, bias included, of the time from `begin` to `end` seconds ago; w stands
 * for what is not kept. */
static void add_mean_rate(const plr_camera_model *camera, plr_real begin, plr_real end,
                          const plr_real w[3], plr_real share, plr_real mean[3]) {
    const plr_real each = share / (begin - end);
    plr_real at = 0;
    for (unsigned k = 0; k <= PLR_CLOCK_STEPS && at < begin; k++) {
        const plr_real *step = k < PLR_CLOCK_STEPS ? camera->estimate.step[k] : NULL;
        const plr_real *rate = step ? step + 1 : w;
        const plr_real next = step && at + step[0] < begin ? at + step[0] : begin;
        const plr_real seconds = next - (at > end ? at : end);
        for (unsigned i = 0; i < 3 && seconds > 0; i++)
            mean[i] = PLR_FMA(each * seconds, rate[i], mean[i]);
        at = next;
    }
}

/* The mean rate over the camera's offset, bias included. In the past it is that of the steps by which the body was
 * turned: so their noise, which stands in the pose, is taken back with them. Of the future it is what goes
 * on evenly: the last mean and its change. */
static void mean_rate(const plr_camera_model *camera, plr_real tau, const plr_real w[3],
                      plr_real mean[3]) {
    memset(mean, 0, 3 * sizeof *mean);
    if (tau < 0) {
        add_mean_rate(camera, -tau, 0, w, 1, mean);
    } else if (tau > 0) {
        add_mean_rate(camera, tau, 0, w, 2, mean);
        add_mean_rate(camera, 2 * tau, tau, w, -1, mean);
    } else {
        memcpy(mean, w, 3 * sizeof *mean);
    }
}

void plr_calibration_at_frame(const plr_belief *belief, plr_camera_model *camera,
                              const plr_source *source, const plr_real twist_B[PLR_POSE_DIM],
                              const plr_real change[3], const plr_real P_u[PLR_POSE_SQUARE]) {
    const bool imu = plr_has_block(belief, PLR_BLOCK_VELOCITY);
    const plr_real tau = offset_of_clock(camera);
    plr_real u[PLR_POSE_DIM], mean[PLR_POSE_DIM], variance[2] = {0};
    memcpy(u, twist_B, sizeof u);
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        variance[i / 3] += P_u[(PLR_POSE_DIM + 1) * i];
    if (imu) {
        variance[1] = PLR_R(3) * camera->estimate.rate_variance;
        for (unsigned i = 0; i < 3; i++)
            u[3 + i] = camera->estimate.rate[i] - belief->bias[3 + i];
    }
    const bool goes = demand_motion(u, variance[0]), turns = demand_motion(u + 3, variance[1]);
    for (unsigned i = 0; i < 3; i++)
        mean[i] = goes ? PLR_FMA(PLR_R(0.5) * tau, change[i], u[i]) : PLR_R(0);
    mean_rate(camera, tau, camera->estimate.rate, mean + 3);
    for (unsigned i = 3; i < PLR_POSE_DIM; i++)
        mean[i] = turns && imu ? mean[i] - belief->bias[i] : u[i];
    camera->estimate.moves = goes || turns || source->poses_are_given;
    plr_mat6_vec(camera->estimate.twist, camera->Ad_CB, u);
    plr_mat6_vec(camera->estimate.mean_twist, camera->Ad_CB, mean);
    place_eye(camera);
}

void plr_calibration_correct(plr_camera_model *camera, const plr_real *ds) {
    plr_camera_estimate *c = &camera->estimate;
    plr_real by[PLR_CALIBRATION_ERRORS] = {0}, turn[9], before[9], t[3];
    for (unsigned k = 0; k < plr_calibration_estimated(&camera->errors); k++) {
        const unsigned kind = camera->errors.kind[k];
        const bool share = kind == PLR_BASELINE || kind == PLR_FOCAL_LENGTH ||
                           kind == PLR_WHEEL_SCALE || kind == PLR_WHEEL_TRACK;
        by[kind] = ds[k];
        c->moved[k] += share ? PLR_FMA(c->moved[k], ds[k], ds[k]) : ds[k];
    }
    c->eye.baseline = PLR_FMA(by[PLR_BASELINE], c->eye.baseline, c->eye.baseline);
    c->eye.fx = PLR_FMA(by[PLR_FOCAL_LENGTH], c->eye.fx, c->eye.fx);
    c->eye.fy = PLR_FMA(by[PLR_FOCAL_LENGTH], c->eye.fy, c->eye.fy);
    c->eye.cx += by[PLR_CENTRE_X];
    c->eye.cy += by[PLR_CENTRE_Y];
    memcpy(before, c->R, sizeof before);
    memcpy(t, c->t, sizeof t);
    plr_so3_exp(turn, by + PLR_CAMERA_TURN_X);
    plr_mat3_mul(c->R, turn, before);
    plr_so3_orthonormalise(c->R);
    plr_mat3_vec(c->t, turn, t);
    for (unsigned i = 0; i < 3; i++)
        c->t[i] += by[PLR_CAMERA_PLACE_X + i];
    place_eye(camera);
}

/* ---------------------------------------------------------------- what is told */

static void tell_camera(const plr_camera_model *camera, const plr_source *source,
                        plr_calibration *told) {
    const plr_camera_estimate *c = &camera->estimate;
    plr_real R[9], body[3], t[3];
    plr_mat3_mul(R, c->R, camera->given.R_CB);
    plr_mat3_vec(body, camera->given.R_CB, source->imu_arm);
    for (unsigned i = 0; i < 3; i++)
        body[i] = camera->given.t_CB[i] - body[i];
    plr_mat3_vec(t, c->R, body);
    told->fx_px = (double)c->eye.fx;
    told->fy_px = (double)c->eye.fy;
    told->cx_px = (double)c->eye.cx;
    told->cy_px = (double)c->eye.cy;
    told->baseline_m = (double)c->eye.baseline;
    for (unsigned i = 0; i < 9; i++)
        told->T_CB.R[i] = (double)R[i];
    for (unsigned i = 0; i < 3; i++)
        told->T_CB.p[i] = (double)(t[i] + c->t[i]);
}

void plr_calibration_tell(const plr_belief *belief, const plr_camera_model *camera,
                          const plr_source *source, plr_calibration_result *told) {
    const plr_camera_estimate *c = &camera->estimate;
    const plr_error_columns *errors = &camera->errors;
    memset(told, 0, sizeof *told);
    told->t_ns = belief->t_ns;
    tell_camera(camera, source, &told->camera);
    for (unsigned j = 0; j < errors->count; j++) {
        plr_real variance = 0;
        for (unsigned k = j; k < errors->count && (j < plr_calibration_estimated(errors) || k == j);
             k++)
            variance = PLR_FMA(c->factor[K * k + j] * c->factor[K * k + j],
                               errors->variance[k] * c->told[k], variance);
        told->corrected[errors->kind[j]] = (double)c->moved[j];
        told->sigma[errors->kind[j]] = (double)PLR_SQRT(variance);
        if (j < plr_calibration_estimated(errors) && !plr_calibration_refuses(camera, j))
            told->estimated |= (uint16_t)(1U << errors->kind[j]);
    }
}
