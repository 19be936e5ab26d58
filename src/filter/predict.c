// SPDX-License-Identifier: MIT
/* The motion between frames: twists move the pose, and a frame applies the accumulated motion to
 * landmarks and covariance. */
#include "filter/predict.h"

#include <string.h>

#include "filter/filter_internal.h"
#include "filter/guard.h"
#include "math/dense.h"
#include "math/finite.h"
#include "math/small.h"
#include "pelorus/assertions.h"
#include "process/process.h"
#include "process/statistics.h"
#include "state/calibration.h"
#include "state/covariance.h"
#include "state/model.h"
#include "state/motion.h"
#include "state/pose.h"
#include "state/seconds.h"

/* ---------------------------------------------------------------- applying what is accumulated */

static void finish_motion(plr_filter *f) {
    plr_process_walk(&f->belief, &f->source, f->motion.seconds);
    f->source.bias_walked_s += (double)f->motion.seconds;
    plr_motion_clear(&f->belief, &f->motion);
}

void plr_predict_drop(plr_filter *f) {
    if (f->motion.pending)
        plr_covariance_carry_core(&f->belief, &f->motion);
    finish_motion(f);
}

plr_status plr_predict_apply(plr_filter *f, const plr_applied_motion *applied) {
    if (plr_norm2_of_6(applied->z) > 0) {
        plr_real n[PLR_POSE_DIM];
        plr_mat6_vec(n, applied->L, applied->z);
        if (!plr_pose_is_correction(n)) {
            plr_filter_propagate_recovery(f);
            plr_predict_drop(f);
            return plr_filter_diverge(f);
        }
        plr_pose_correct(&f->belief, n);
    }
    plr_model_of(&f->belief)->propagate(&f->belief, &f->camera, &f->motion, &f->work, applied);
    plr_filter_propagate_recovery(f);
    finish_motion(f);
    return plr_covariance_is_positive(&f->belief) ? PLR_OK : plr_filter_diverge(f);
}

plr_status plr_predict_apply_pending(plr_filter *f) {
    plr_applied_motion applied;
    if (!f->motion.pending)
        return PLR_OK;
    plr_motion_prior(&f->belief, &f->motion, &f->work.noise, 1, &applied);
    return plr_predict_apply(f, &applied);
}

plr_status plr_predict_apply_prior(plr_filter *f) {
    plr_status status = plr_predict_apply_pending(f);
    if (status != PLR_OK || !f->work.noise.open)
        return status;
    status = plr_filter_close_noise(f, NULL);
    (void)plr_model_of(&f->belief)
        ->retract(&f->belief, &f->camera, &f->work, f->work.dx); /* restores plr_slot.beyond */
    return status;
}

/* The argument `interval` of a process's step. That of twists adds the variance
 * sigma^2 interval (h1 - h0), when the last reading is used from h0 to h1 seconds after its time.
 * The error of one reading is constant, so its variance grows to sigma^2 max(tau, h) h in h
 * seconds: within the interval tau between readings by the usual sigma^2 tau h, and later, if
 * twists fail to come, to sigma^2 h^2. */
static plr_real noise_interval(const plr_filter *f, plr_real h0, plr_real h1) {
    const plr_real tau = f->source.interval_s;
    if (!f->source.reading_valid || f->config.noise == PLR_NOISE_STEP || h1 <= tau)
        return tau > 0 ? tau : h1 - h0;
    return h0 >= tau ? h0 + h1 : (h1 * h1 - tau * h0) / (h1 - h0);
}

static void take_step(plr_filter *f, plr_time_ns t_ns, const plr_process_step *step) {
    plr_process_of(&f->source)->step(&f->belief, &f->motion, &f->source, t_ns, step);
    plr_calibration_note_step(&f->camera, step->mean, step->seconds);
}

/* Adds what the last reading misses between h0 and h1 seconds after its time. */
static void add_missed(plr_filter *f, plr_real h0, plr_real h1, const plr_real *next) {
    plr_real variance[PLR_POSE_DIM];
    if (!f->source.reading_valid || !plr_process_of(&f->source)->missed ||
        !plr_process_of(&f->source)->missed(&f->source, h0, h1, next, variance))
        return;
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        f->motion.Q[(PLR_POSE_DIM + 1) * i] += variance[i];
}

/* The filter's time moves. */
static void set_time(plr_filter *f, plr_time_ns t_ns) {
    f->belief.t_ns = t_ns;
    f->clock_started = 1;
    f->source.unused = 0;
}

void plr_predict_to(plr_filter *f, plr_time_ns t_ns) {
    if (f->clock_started && t_ns > f->belief.t_ns && plr_process_has_started(&f->source)) {
        const plr_time_ns since = f->source.reading_valid ? f->source.reading_ns : f->belief.t_ns;
        const plr_real h0 = plr_seconds(f->belief.t_ns - since), h1 = plr_seconds(t_ns - since);
        plr_process_step step = {.seconds = plr_seconds(t_ns - f->belief.t_ns),
                                 .interval = noise_interval(f, h0, h1)};
        plr_process_of(&f->source)->hold(&f->belief, &f->source, h0, step.mean);
        memcpy(step.whole, step.mean, sizeof step.whole);
        take_step(f, t_ns, &step);
        add_missed(f, h0, h1, NULL);
    }
    set_time(f, t_ns);
}

/* ---------------------------------------------------------------- refused readings */

/* What nobody knows of a pose: (1 km)^2, and of an angle pi^2 / 3. */
#define UNKNOWN_WAY2  PLR_R(1e6)
#define UNKNOWN_TURN2 PLR_R(3.29)
/* The variance of the rate of a body that an IMU moves, each axis, (rad/s)^2. */
#define USUAL_RATE2 PLR_R(1)

/* The squares of what may be the body's speed and rate: as they were last, and with what they may have changed by. */
static void speeds2(const plr_filter *f, plr_real *speed2, plr_real *rate2) {
    plr_real u[PLR_POSE_DIM];
    const plr_source *source = &f->source;
    const bool inertial = source->process == PLR_PROCESS_IMU;
    plr_process_of(source)->now(&f->belief, &f->motion, source, u, NULL);
    *speed2 = plr_dot3(u, u);
    *rate2 = plr_dot3(u + 3, u + 3);
    for (unsigned i = 0; i < 3; i++) {
        *speed2 += inertial ? source->start_velocity_variance : source->velocity_variance[i];
        *rate2 += inertial ? USUAL_RATE2 : source->gyro_variance[i];
    }
}

static plr_real at_most(plr_real x, plr_real most) {
    return x < most ? x : most;
}

/* The filter's time stands still while readings come that it does not take: their times are wrong, or another clock's.
 * The body moves on. Once they are more than max-gap would hold, the pose may be wrong by the way of all of them: what
 * the last one adds is the motion's noise. */
static void open_by_refused(plr_filter *f) {
    const plr_real usual = f->source.inertial.usual_s;
    const plr_real now = usual * (plr_real)f->source.unused, before = now - usual;
    const plr_real gap = plr_seconds(f->par.max_gap_ns);
    plr_real speed2, rate2;
    if (!(now > gap) || !plr_process_has_started(&f->source))
        return;
    const plr_real from2 = before > gap ? before * before : PLR_R(0), to2 = now * now;
    speeds2(f, &speed2, &rate2);
    const plr_real way2 =
        at_most(speed2 * to2, UNKNOWN_WAY2) - at_most(speed2 * from2, UNKNOWN_WAY2);
    const plr_real turn2 =
        at_most(rate2 * to2, UNKNOWN_TURN2) - at_most(rate2 * from2, UNKNOWN_TURN2);
    for (unsigned i = 0; i < 3; i++) {
        f->motion.Q[(PLR_POSE_DIM + 1) * i] += way2;
        f->motion.Q[(PLR_POSE_DIM + 1) * (3 + i)] += turn2;
    }
    f->motion.pending = f->motion.noisy = 1;
}

plr_status plr_predict_refuse(plr_filter *f, plr_status status) {
    f->totals.twists_refused++;
    if (status != PLR_E_MODE) {
        f->source.unused += f->source.unused < UINT32_MAX;
        open_by_refused(f);
    }
    return plr_filter_refuse(f, status);
}

/* ---------------------------------------------------------------- twists */

static plr_status check_time(const plr_filter *f, plr_time_ns t_ns) {
    if (!f->clock_started)
        return PLR_OK;
    if ((f->source.reading_valid && t_ns <= f->source.reading_ns) || t_ns < f->belief.t_ns)
        return PLR_E_TIME;
    return t_ns - f->belief.t_ns > f->par.max_gap_ns ? PLR_E_GAP : PLR_OK;
}

/* Checks that the reading can be held for a usual interval. With timing start it is used only when
 * the next one comes; were it refused then, so would be all that follow. */
static plr_status check_reading(const plr_filter *f, const plr_real reading[PLR_POSE_DIM],
                                plr_real interval) {
    const plr_real first = PLR_R(1e-3); /* there is no interval yet */
    plr_real seconds = interval > 0 ? interval : first;
    if (f->source.interval_s > 0 &&
        f->source.interval_s < seconds) /* a longer pause is not expected to be repeated */
        seconds = f->source.interval_s;
    return plr_process_of(&f->source)->check(&f->belief, &f->source, reading, seconds);
}

static void store_reading(plr_filter *f, plr_time_ns t_ns, const plr_real reading[PLR_POSE_DIM],
                          plr_real interval) {
    PLR_ASSERT(interval >= 0);
    memcpy(f->source.reading, reading, sizeof f->source.reading);
    f->source.reading_ns = t_ns;
    f->source.reading_valid = 1;
    f->source.interval_s = interval;
    f->totals.twists++;
}

plr_status plr_predict_plan(const plr_filter *f, plr_time_ns t_ns,
                            const plr_real reading[PLR_POSE_DIM], plr_process_step *step) {
    if (f->config.mode == PLR_MODE_MAPPING)
        return PLR_OK;
    const plr_status status = check_time(f, t_ns);
    if (status != PLR_OK)
        return status;
    step->seconds = f->clock_started ? plr_seconds(t_ns - f->belief.t_ns) : 0;
    step->interval = f->source.reading_valid && f->source.reading_ns != f->belief.t_ns
                         ? plr_seconds(t_ns - f->source.reading_ns)
                         : step->seconds;
    plr_process_of(&f->source)->mean(&f->belief, &f->source, t_ns, reading, step);
    if (plr_process_of(&f->source)->check(&f->belief, &f->source, step->mean, step->seconds) !=
            PLR_OK ||
        check_reading(f, reading, step->interval) != PLR_OK)
        return PLR_E_RANGE;
    return PLR_OK;
}

plr_status plr_predict_accept(plr_filter *f, plr_time_ns t_ns, const plr_real reading[PLR_POSE_DIM],
                              plr_status planned, const plr_process_step *step) {
    if (planned != PLR_OK)
        return plr_predict_refuse(f, planned);
    if (f->config.mode == PLR_MODE_MAPPING) {
        f->totals.twists++;
        plr_guard_seal(f);
        return PLR_OK;
    }
    if (step->seconds > 0 && plr_process_has_started(&f->source)) {
        take_step(f, t_ns, step);
        add_missed(f, step->interval - step->seconds, step->interval, reading);
    }
    set_time(f, t_ns);
    store_reading(f, t_ns, reading, step->interval);
    plr_guard_seal(f);
    return PLR_OK;
}

plr_status plr_filter_predict(plr_filter *f, plr_time_ns t_ns, const plr_twist *twist) {
    const plr_status sound = twist ? plr_guard_check_reading(f) : PLR_E_ARGUMENT;
    if (sound != PLR_OK)
        return sound;
    if (f->config.process != PLR_PROCESS_TWIST)
        return plr_predict_refuse(f, PLR_E_MODE);
    if (!plr_all_finite(twist->v_B_mps, 3) || !plr_all_finite(twist->w_B_radps, 3))
        return plr_predict_refuse(f, PLR_E_NOT_FINITE);

    plr_real reading[PLR_POSE_DIM];
    for (int i = 0; i < 3; i++) {
        reading[i] = (plr_real)twist->v_B_mps[i];
        reading[3 + i] = (plr_real)twist->w_B_radps[i];
        if (!plr_is_finite(reading[i]) || !plr_is_finite(reading[3 + i]))
            return plr_predict_refuse(f, PLR_E_RANGE);
    }
    plr_process_step step;
    const plr_status planned = plr_predict_plan(f, t_ns, reading, &step);
    if (planned == PLR_OK && f->config.mode != PLR_MODE_MAPPING) {
        plr_real change2[2];
        plr_statistics_change(&f->source, reading, change2);
        plr_statistics_learn(&f->belief, &f->source, t_ns, reading, step.interval, change2);
    }
    return plr_predict_accept(f, t_ns, reading, planned, &step);
}
