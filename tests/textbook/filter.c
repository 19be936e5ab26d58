// SPDX-License-Identifier: MIT
/* The filter's life and its motion. */
#include <math.h>
#include <string.h>

#include "textbook/program.h"
#include "textbook/the_filter.h"

struct the_filter the;

void textbook_program_reserve(unsigned landmarks, unsigned observations) {
    the.most_landmarks = landmarks;
    the.most_seen = observations;
}

/* ---------------------------------------------------------------- life */

plr_status plr_filter_init_sized(plr_filter *f, const plr_calibration *calibration,
                                 const plr_config *config, const plr_map *map,
                                 const plr_sizes *caller) {
    static const plr_map none = {0};
    (void)f;
    (void)caller; /* one program, compiled at once */
    the.ready = false;
    if (!calibration || !config)
        return PLR_E_ARGUMENT;
    if (plr_config_check(config, NULL) != PLR_OK)
        return PLR_E_CONFIG;
    if (!(calibration->fx_px > 0) || !(calibration->fy_px > 0) || !(calibration->baseline_m > 0))
        return PLR_E_CALIBRATION;
    textbook_free(&the.book);
    if (!textbook_init(&the.book, calibration, config, the.most_landmarks, the.most_seen))
        return PLR_E_FULL;
    the.map = map ? *map : none;
    the.ready = true;
    return plr_filter_reset(f);
}

plr_status plr_filter_reset(plr_filter *f) {
    (void)f;
    if (!the.ready)
        return PLR_E_NOT_READY;
    textbook_reset(&the.book);
    the.t_ns = the.reading_ns = 0;
    the.interval_s = 0;
    the.clock_started = the.reading_valid = false;
    the.frames_mostly_gated = the.frames_without_use = 0;
    memset(&the.reading, 0, sizeof the.reading);
    memset(&the.totals, 0, sizeof the.totals);
    return PLR_OK;
}

plr_status the_filter_refuses(plr_status status) {
    if (status == PLR_E_LATE)
        the.totals.late++;
    else
        the.totals.refused++;
    return status;
}

static bool is_finite(const double *x, unsigned n) {
    bool finite = true;
    for (unsigned i = 0; i < n; i++)
        finite = finite && isfinite(x[i]);
    return finite;
}

static void stand_at(plr_time_ns t_ns) {
    the.t_ns = t_ns;
    the.clock_started = true;
}

plr_status plr_filter_set_pose(plr_filter *f, plr_time_ns t_ns, const plr_pose *T_WB,
                               const double *P_xi) {
    const double sigma = the.book.config.start_sigma;
    double P[36] = {0};
    (void)f;
    if (!the.ready)
        return PLR_E_NOT_READY;
    if (the.book.config.mode == PLR_MODE_MAPPING)
        return the_filter_refuses(PLR_E_MODE);
    if (!is_finite(T_WB->R, 9) || !is_finite(T_WB->p, 3) || (P_xi && !is_finite(P_xi, 36)))
        return the_filter_refuses(PLR_E_NOT_FINITE);
    for (int i = 0; i < 6; i++)
        P[7 * i] = sigma * sigma;
    textbook_set_pose(&the.book, T_WB, P_xi ? P_xi : P);
    the.book.diverged = false;
    the.totals.resets += the.clock_started;
    the.frames_mostly_gated = the.frames_without_use = 0;
    if (the.reading_ns > t_ns) /* of another clock */
        the.reading_valid = false;
    stand_at(t_ns);
    return PLR_OK;
}

plr_status plr_filter_set_bias(plr_filter *f, const double *mean, const double *variance) {
    (void)f;
    if (!the.ready)
        return PLR_E_NOT_READY;
    if (!the.book.config.bias || the.clock_started || the.book.config.mode == PLR_MODE_MAPPING)
        return the_filter_refuses(PLR_E_MODE);
    if (!is_finite(mean, 6) || !is_finite(variance, 6))
        return the_filter_refuses(PLR_E_NOT_FINITE);
    textbook_set_bias(&the.book, mean, variance);
    return PLR_OK;
}

/* ---------------------------------------------------------------- motion */

static double seconds_between(plr_time_ns from, plr_time_ns to) {
    return (double)(to - from) * 1e-9;
}

bool the_filter_finds_a_gap(plr_time_ns t_ns) {
    return t_ns > the.t_ns && seconds_between(the.t_ns, t_ns) > the.book.config.max_gap_s;
}

/* Could this twist be held so long? Within half a turn and a kilometre. */
static bool is_a_step(const plr_twist *twist, double seconds) {
    double way = 0, turn = 0;
    for (int i = 0; i < 3; i++) {
        way += twist->v_B_mps[i] * twist->v_B_mps[i];
        turn += twist->w_B_radps[i] * twist->w_B_radps[i];
    }
    return seconds * sqrt(way) <= 1000 && seconds * sqrt(turn) <= 3.1415926;
}

/* The twist of the step that ends with this reading (docs/MATH.md 4). */
static plr_twist twist_of_step(const plr_twist *reading) {
    const uint8_t timing = the.reading_valid ? the.book.config.twist_timing : PLR_TWIST_END;
    plr_twist held = timing == PLR_TWIST_START ? the.reading : *reading;
    for (int i = 0; timing == PLR_TWIST_MID && i < 3; i++) {
        held.v_B_mps[i] = (the.reading.v_B_mps[i] + reading->v_B_mps[i]) / 2;
        held.w_B_radps[i] = (the.reading.w_B_radps[i] + reading->w_B_radps[i]) / 2;
    }
    return held;
}

/* The textbook knows no small sensors. */
plr_status plr_filter_measure(plr_filter *f, const plr_reading *reading,
                              plr_reading_result *result) {
    (void)f;
    (void)reading;
    (void)result;
    return the.ready ? the_filter_refuses(PLR_E_MODE) : PLR_E_NOT_READY;
}

/* Nor an IMU. */
plr_status plr_filter_inertial(plr_filter *f, plr_time_ns t_ns, const plr_imu *reading) {
    (void)f;
    (void)t_ns;
    (void)reading;
    return the.ready ? the_filter_refuses(PLR_E_MODE) : PLR_E_NOT_READY;
}

plr_status plr_filter_set_velocity(plr_filter *f, const double v_B_mps[3],
                                   const double variance[3]) {
    (void)f;
    (void)v_B_mps;
    (void)variance;
    return the.ready ? the_filter_refuses(PLR_E_MODE) : PLR_E_NOT_READY;
}

plr_imu_fault plr_filter_imu_fault(const plr_filter *f) {
    (void)f;
    return PLR_IMU_FAULT_NONE;
}

plr_status plr_filter_predict(plr_filter *f, plr_time_ns t_ns, const plr_twist *twist) {
    (void)f;
    if (!the.ready)
        return PLR_E_NOT_READY;
    if (!is_finite(twist->v_B_mps, 3) || !is_finite(twist->w_B_radps, 3))
        return the_filter_refuses(PLR_E_NOT_FINITE);
    if (the.book.config.mode == PLR_MODE_MAPPING) {
        the.totals.twists++;
        return PLR_OK;
    }
    if (the.clock_started && ((the.reading_valid && t_ns <= the.reading_ns) || t_ns < the.t_ns))
        return the_filter_refuses(PLR_E_TIME);
    if (the.clock_started && the_filter_finds_a_gap(t_ns))
        return the_filter_refuses(PLR_E_GAP);
    const plr_twist held = twist_of_step(twist);
    const double seconds = the.clock_started ? seconds_between(the.t_ns, t_ns) : 0;
    const double interval = the.reading_valid ? seconds_between(the.reading_ns, t_ns) : seconds;
    if (!is_a_step(&held, seconds) || !is_a_step(twist, seconds > 0 ? seconds : 1e-3))
        return the_filter_refuses(PLR_E_RANGE);
    if (seconds > 0)
        textbook_hold(&the.book, &held, seconds, interval);
    stand_at(t_ns);
    the.reading = *twist;
    the.reading_ns = t_ns;
    the.reading_valid = true;
    the.interval_s = interval;
    the.totals.twists++;
    return PLR_OK;
}

/* Holds the last reading up to a frame. Its error stays the same: after h seconds it has cost sigma^2
 * max(interval, h) h. */
void the_filter_holds_until(plr_time_ns t_ns) {
    if (the.clock_started && t_ns > the.t_ns) {
        const plr_time_ns since = the.reading_valid ? the.reading_ns : the.t_ns;
        const double h0 = seconds_between(since, the.t_ns), h1 = seconds_between(since, t_ns);
        const double tau = the.interval_s;
        double interval = tau > 0 ? tau : h1 - h0;
        if (the.reading_valid && the.book.config.noise != PLR_NOISE_STEP && h1 > tau)
            interval = h0 >= tau ? h0 + h1 : (h1 * h1 - tau * h0) / (h1 - h0);
        textbook_hold(&the.book, &the.reading, h1 - h0, interval);
    }
    stand_at(t_ns);
}

plr_status plr_filter_move_to(plr_filter *f, plr_time_ns t_ns, const plr_pose *T_WB) {
    (void)f;
    if (!the.ready)
        return PLR_E_NOT_READY;
    if (the.book.config.mode != PLR_MODE_MAPPING)
        return the_filter_refuses(PLR_E_MODE);
    if (!is_finite(T_WB->R, 9) || !is_finite(T_WB->p, 3))
        return the_filter_refuses(PLR_E_NOT_FINITE);
    if (the.clock_started && t_ns <= the.t_ns)
        return the_filter_refuses(PLR_E_TIME);
    textbook_move_to(&the.book, T_WB);
    stand_at(t_ns);
    return PLR_OK;
}

/* The textbook trusts: it has no supervisor, and no rules to leave out. */
plr_status plr_filter_calibration(const plr_filter *f, plr_calibration_result *result) {
    (void)f;
    (void)result;
    return PLR_E_MODE;
}

plr_status plr_filter_supervision(const plr_filter *f, plr_supervision *supervision) {
    (void)f;
    memset(supervision, 0, sizeof *supervision);
    return PLR_E_NOT_READY;
}

plr_status plr_filter_leave_out(plr_filter *f, uint64_t limits) {
    (void)f;
    return limits ? PLR_E_RANGE : PLR_OK;
}

const plr_limit_row *plr_limit_at(unsigned row) {
    (void)row;
    return NULL;
}
