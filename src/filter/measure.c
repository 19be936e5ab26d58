// SPDX-License-Identifier: MIT
/* Readings of small sensors: each is checked and gated, then applied, or held until the next
 * one. */
#include "filter/measure.h"

#include <string.h>

#include "filter/correction.h"
#include "filter/extrinsics.h"
#include "filter/filter_internal.h"
#include "filter/gate.h"
#include "filter/guard.h"
#include "filter/predict.h"
#include "math/dense.h"
#include "math/finite.h"
#include "math/small.h"
#include "pelorus/assertions.h"
#include "process/alignment.h"
#include "process/process.h"
#include "process/velocity.h"
#include "process/wheels.h"
#include "sensor/sensor.h"
#include "state/blocks.h"
#include "state/calibration.h"
#include "state/motion.h"
#include "state/seconds.h"
#include "state/sensitivity.h"
#include "supervise/supervise.h"

/* Beyond this a lever arm or a sigma is an error of the sender, m and so on. */
#define MAX_ARM   1e3
#define MAX_SIGMA 1e6
/* A larger step is rejected, m: the pose has to be set instead. */
#define MAX_STEP PLR_R(900)
/* A reading may be this many times epsilon sharper than its prediction, in variance: a variance
 * that shrinks by more digits than a number has is lost. */
#define SHARPEST PLR_R(256)

static plr_status check_numbers(const plr_reading *reading) {
    const plr_sensor_kind *kind = plr_sensor_of(reading->sensor);
    if (!kind || reading->axes < 1 || (reading->axes & ~kind->axes) != 0)
        return PLR_E_ARGUMENT;
    if (!plr_all_finite(reading->value, 3) || !plr_all_finite(reading->at_B_m, 3))
        return PLR_E_NOT_FINITE;
    if (kind->most_value == 0 && !plr_all_within(reading->value, 3, 0))
        return PLR_E_ARGUMENT;
    if (!plr_all_within(reading->value, 3, kind->most_value) ||
        !plr_all_within(reading->at_B_m, 3, MAX_ARM))
        return PLR_E_RANGE;
    for (unsigned i = 0; i < 3; i++) {
        if (!plr_reading_has(reading, i))
            continue;
        if (!plr_all_finite(reading->sigma + i, 1))
            return PLR_E_NOT_FINITE;
        if (!((plr_real)(reading->sigma[i] * reading->sigma[i]) > 0))
            return PLR_E_ARGUMENT;
        if (reading->sigma[i] > MAX_SIGMA)
            return PLR_E_RANGE;
    }
    return PLR_OK;
}

/* A reading of the state that comes once more says nothing new. (One of the twist takes the place of the
 * last.) */
static bool repeats(const plr_filter *f, const plr_reading *reading) {
    return plr_sensor_of(reading->sensor)->of_state &&
           plr_supervise_repeats(&f->supervisor, reading);
}

static plr_status check_time(const plr_filter *f, const plr_reading *reading) {
    if (f->config.mode == PLR_MODE_MAPPING)
        return PLR_E_MODE;
    if (!plr_process_has_started(&f->source))
        return PLR_E_NOT_READY;
    if (!f->clock_started || !f->source.reading_valid || repeats(f, reading))
        return PLR_E_TIME;
    if (reading->t_ns < f->belief.t_ns)
        return PLR_E_LATE;
    if (reading->t_ns - f->belief.t_ns > f->par.max_gap_ns)
        return PLR_E_GAP;
    return plr_process_of(&f->source)
        ->check(&f->belief, &f->source, f->source.reading,
                plr_seconds(reading->t_ns - f->belief.t_ns));
}

/* d^2 = r^T (M P M^T + R)^-1 r of three rows M over six numbers of covariance P; negative if that
 * cannot be factorised. */
static plr_real distance2(const plr_real M[PLR_ROWS * PLR_POSE_DIM],
                          const plr_real P[PLR_POSE_SQUARE], const plr_real R[PLR_ROWS],
                          const plr_real r[PLR_ROWS]) {
    plr_real S[9] = {0}, MP[PLR_ROWS * PLR_POSE_DIM], U[6], e[PLR_ROWS];
    plr_sandwich3(S, MP, M, P);
    for (unsigned i = 0; i < PLR_ROWS; i++)
        S[4 * i] += R[i];
    if (!plr_factorise3(U, S))
        return -1;
    memcpy(e, r, sizeof e);
    plr_solve3_transposed(1, U, e);
    return plr_dot3(e, e);
}

static bool passes(const plr_filter *f, plr_real d2) {
    return d2 >= 0 && plr_is_finite(d2) && (f->par.gate_d2 <= 0 || d2 <= f->par.gate_d2);
}

/* Gates a reading of the twist, and holds it. */
static bool hold(plr_filter *f, const plr_sensor_kind *kind, const plr_reading *reading,
                 plr_reading_result *result) {
    plr_twist_rows rows[2];
    plr_real u[PLR_POSE_DIM], P_u[PLR_POSE_SQUARE];
    bool accepted = true;
    const unsigned parts = kind->of_twist(reading, rows);
    plr_process_of(&f->source)->now(&f->belief, &f->motion, &f->source, u, P_u);
    for (unsigned part = 0; part < parts; part++) {
        plr_real r[PLR_ROWS];
        for (unsigned i = 0; i < PLR_ROWS; i++) {
            r[i] = rows[part].z[i];
            for (unsigned c = 0; c < PLR_POSE_DIM; c++)
                r[i] = PLR_FMA(-rows[part].M[PLR_POSE_DIM * i + c], u[c], r[i]);
        }
        const plr_real d2 = distance2(rows[part].M, P_u, rows[part].R, r);
        result->d2 += d2 > 0 ? (double)d2 : 0;
        accepted = passes(f, d2) && accepted;
    }
    for (unsigned part = 0; accepted && part < parts; part++)
        plr_velocity_hold(&f->belief, &f->source, kind->place + part, &rows[part]);
    return accepted;
}

/* The pending motion has been applied, with this status: corrects the state by measurements that were
 * accepted. False if the filter had to recover. */
static bool correct(plr_filter *f, plr_status status, const plr_measurement *m, unsigned count) {
    if (status == PLR_OK)
        status = plr_correct(f, NULL, m, count).status;
    if (status != PLR_OK)
        plr_filter_recover(f);
    return status == PLR_OK;
}

/* True if an error of the wheels is considered or estimated. */
static bool has_wheel_errors(const plr_filter *f) {
    const plr_error_columns *errors = &f->camera.errors;
    return plr_calibration_column(errors, PLR_WHEEL_SCALE) < errors->count ||
           plr_calibration_column(errors, PLR_WHEEL_TRACK) < errors->count;
}

/* Where velocity is estimated, a reading of the twist is one of the state: gates it, and applies it. Of a wheel's it
 * has measured the axes `measured` itself. */
static bool apply_to_velocity(plr_filter *f, const plr_sensor_kind *kind,
                              const plr_reading *reading, uint8_t measured,
                              plr_reading_result *result) {
    plr_twist_rows rows[2];
    plr_measurement m[2];
    bool accepted = true;
    const unsigned parts = kind->of_twist(reading, rows);
    plr_filter_note_motion(f);
    const plr_status status = plr_predict_apply_pending(f);
    memset(m, 0, sizeof m);
    for (unsigned part = 0; part < parts && status == PLR_OK; part++) {
        plr_process_of(&f->source)
            ->measure(&f->belief, &f->source, &rows[part], &m[part].H, m[part].r, m[part].R);
        m[part].of_wheel = reading->sensor == PLR_SENSOR_WHEEL && has_wheel_errors(f);
        if (m[part].of_wheel)
            plr_wheels_differentiate(&f->belief, &f->source, &f->camera, reading, measured,
                                     rows[part].z, m[part].r, &m[part].by_wheel);
        const plr_verdict verdict = m[part].of_wheel ? plr_gate_judge_wheel(f, &m[part])
                                                     : plr_gate_judge(f, false, &m[part]);
        result->d2 += (double)verdict.d2;
        accepted = accepted && verdict.accepted;
        if (reading->sensor == PLR_SENSOR_WHEEL)
            accepted = plr_wheels_hold(&f->source, m[part].r, accepted);
    }
    if (reading->sensor == PLR_SENSOR_STANDSTILL)
        f->source.inertial.still_ns = f->belief.t_ns;
    return correct(f, status, m, accepted ? parts : 0) && accepted;
}

/* The place is p + R (rho + theta x rho / 2 + ...), and H has the first order alone. Where the other axes
 * and the tilt are uncertain the second order is larger than a sigma, and a height would pass for a
 * measurement of tilt. This is about its variance. Axes that are measured do not count: the reading
 * itself makes them certain. */
static plr_real second_order(const plr_filter *f, const plr_reading *reading,
                             const plr_real P[PLR_POSE_SQUARE]) {
    plr_real way = 0, turn = 0;
    for (unsigned axis = 0; axis < 3; axis++) {
        plr_real row[3] = {0};
        turn += P[(PLR_POSE_DIM + 1) * (3 + axis)];
        if (plr_reading_has(reading, axis))
            continue;
        for (unsigned i = 0; i < 3; i++)
            for (unsigned j = 0; j < 3; j++)
                row[i] = PLR_FMA(P[PLR_POSE_DIM * i + j], f->belief.R_WB[3 * axis + j], row[i]);
        way += plr_dot3(row, f->belief.R_WB + 3 * axis);
    }
    return PLR_R(0.25) * way * turn;
}

/* R <- times R + more, of the numbers that were measured. */
static void widen(const plr_reading *reading, plr_real times, plr_real more, plr_real R[PLR_ROWS]) {
    for (unsigned i = 0; i < PLR_ROWS; i++)
        if (plr_reading_has(reading, i))
            R[i] = PLR_FMA(times, R[i], more);
}

/* H by the present pose becomes that by the pose in P, which stands before the motion that is held. */
static void by_pose_before_motion(const plr_belief *belief, plr_term *H) {
    plr_real A[PLR_POSE_SQUARE], HA[PLR_ROWS * PLR_POSE_DIM] = {0};
    plr_motion_held_adjoint(belief, A);
    plr_gemm_nn(PLR_ROWS, PLR_POSE_DIM, PLR_POSE_DIM, H->H, PLR_POSE_DIM, A, PLR_POSE_DIM, HA,
                PLR_POSE_DIM);
    memcpy(H->H, HA, sizeof HA);
}

/* Gates a reading of the state by the pose's present covariance, and applies it. A rejected one
 * changes nothing. */
static bool apply(plr_filter *f, const plr_sensor_kind *kind, const plr_reading *reading,
                  plr_reading_result *result) {
    plr_measurement m;
    plr_real P_xi[PLR_POSE_SQUARE], S[9] = {0}, HP[PLR_ROWS * PLR_POSE_DIM];
    memset(&m, 0, sizeof m);
    for (unsigned i = 0; i < PLR_ROWS; i++)
        m.R[i] = 1;
    kind->of_state(&f->belief, reading, &m);
    PLR_ASSERT(m.H.terms == 1 && m.H.term[0].row == plr_row_of(&f->belief, PLR_BLOCK_POSE));
    plr_motion_pose_covariance(&f->belief, &f->motion, P_xi);
    plr_supervise_enlarge(&f->supervisor, f->motion.E, f->motion.p, P_xi);
    if (kind->bounds_position != 0)
        widen(reading, 1, second_order(f, reading, P_xi), m.R);
    plr_sandwich3(S, HP, m.H.term[0].H, P_xi);
    for (unsigned i = 0; i < PLR_ROWS; i++)
        m.R[i] = PLR_FMA(SHARPEST * PLR_EPSILON, S[4 * i], m.R[i]);
    plr_sensitivity_add_to_pose(&f->belief, &f->camera, &f->motion,
                                P_xi); /* a camera that is off by a share is no wrong reading */
    plr_real d2 = distance2(m.H.term[0].H, P_xi, m.R, m.r);
    result->d2 = d2 > 0 ? (double)d2 : 0;
    const plr_real wider = plr_supervise_widening(&f->supervisor, reading->sensor);
    if (wider > 1) {
        widen(reading, wider, 0, m.R);
        d2 = distance2(m.H.term[0].H, P_xi, m.R, m.r);
    }
    if (!passes(f, d2) || plr_dot3(m.r, m.r) > MAX_STEP * MAX_STEP)
        return false;
    plr_filter_note_motion(f);
    const plr_status status = plr_predict_apply_pending(f);
    by_pose_before_motion(&f->belief, &m.H.term[0]);
    return correct(f, status, &m, 1);
}

static void count(plr_filter *f, const plr_reading_result *result) {
    f->totals.readings++;
    f->totals.readings_gated += !result->used;
}

bool plr_measure_twist(plr_filter *f, const plr_reading *reading, plr_reading_result *result) {
    const plr_sensor_kind *kind = plr_sensor_of(reading->sensor);
    plr_reading whole = *reading;
    PLR_ASSERT(kind->of_twist);
    if (reading->sensor == PLR_SENSOR_WHEEL) {
        plr_wheels_note(&f->source, reading);
        plr_wheels_correct(&f->source, &f->camera, &whole);
        plr_wheels_deny_slide(&whole, f->config.wheel_slide_sigma_mps);
    }
    result->used = plr_process_of(&f->source)->measure
                       ? apply_to_velocity(f, kind, &whole, reading->axes, result)
                       : hold(f, kind, &whole, result);
    count(f, result);
    return result->used;
}

static bool measure(plr_filter *f, const plr_reading *reading, plr_reading_result *result) {
    const plr_sensor_kind *kind = plr_sensor_of(reading->sensor);
    if (kind->of_twist)
        return plr_measure_twist(f, reading, result);
    result->used = apply(f, kind, reading, result);
    count(f, result);
    if (result->used)
        plr_alignment_keep_world(&f->source);
    return result->used;
}

static void supervise(plr_filter *f, const plr_reading *reading, bool used, double d2) {
    const uint8_t bounding = plr_sensor_of(reading->sensor)->bounds_position;
    const bool bounds = bounding != 0 && (reading->axes & bounding) == bounding;
    unsigned numbers = 0;
    for (unsigned i = 0; i < 3; i++)
        numbers += plr_reading_has(reading, i);
    if (reading->sensor == PLR_SENSOR_STANDSTILL) /* three of each of its bits */
        numbers *= 3;
    if (reading->sensor == PLR_SENSOR_WHEEL && f->config.wheel_slide_sigma_mps > 0)
        numbers = PLR_ROWS;
    plr_supervise_reading(&f->supervisor, reading, numbers, used, (plr_real)d2, bounds,
                          f->belief.t_ns);
}

/* Wheels that stand measure a standstill, as pictures do that stand. */
static void rest_by_wheels(plr_filter *f) {
    const double sigma = f->config.standstill_sigma_mps;
    plr_reading still = {.t_ns = f->belief.t_ns,
                         .sensor = PLR_SENSOR_STANDSTILL,
                         .axes = 3,
                         .sigma = {sigma, sigma, 0}};
    plr_reading_result unused = {0};
    if (sigma > 0 && plr_wheels_stand(&f->source, f->belief.t_ns))
        (void)plr_measure_twist(f, &still, &unused);
}

static plr_status refuse(plr_filter *f, plr_status status, plr_reading_result *result) {
    f->totals.readings_refused++;
    result->status = status;
    return plr_filter_refuse(f, status);
}

plr_status plr_filter_measure(plr_filter *f, const plr_reading *reading,
                              plr_reading_result *result) {
    plr_reading_result scratch;
    plr_reading_result *got = result ? result : &scratch;
    memset(got, 0, sizeof *got);
    if (!f || !reading)
        return got->status = PLR_E_ARGUMENT;
    const plr_status sound = plr_guard_check_whole(f);
    if (sound != PLR_OK)
        return got->status = sound;
    plr_status status = check_numbers(reading);
    if (status == PLR_OK)
        status = check_time(f, reading);
    if (status != PLR_OK)
        return refuse(f, status, got);
    plr_reading seen_from_imu = *reading;
    plr_extrinsics_place_in(f, seen_from_imu.at_B_m);
    plr_predict_to(f, reading->t_ns);
    const bool used = measure(f, &seen_from_imu, got);
    supervise(f, reading, used, got->d2);
    if (used && reading->sensor == PLR_SENSOR_WHEEL)
        rest_by_wheels(f);
    plr_guard_seal_whole(f);
    return PLR_OK;
}
