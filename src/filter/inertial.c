// SPDX-License-Identifier: MIT
/* Readings of an IMU: bad ones are refused, those of before the start are averaged, all others move
 * the state. */
#include "filter/inertial.h"

#include <string.h>

#include "filter/extrinsics.h"
#include "filter/filter_internal.h"
#include "filter/guard.h"
#include "filter/predict.h"
#include "limits/limits.h"
#include "math/finite.h"
#include "math/small.h"
#include "process/alignment.h"
#include "process/statistics.h"
#include "sensor/stereo.h"
#include "state/calibration.h"
#include "state/seconds.h"

/* The largest velocity that can be set, m/s. */
#define MAX_VELOCITY 1e4

static plr_status refuse(plr_filter *f, plr_status status, plr_imu_fault fault) {
    if (fault != PLR_IMU_FAULT_NONE)
        f->source.inertial.fault = (uint8_t)fault;
    return plr_predict_refuse(f, status);
}

/* True if one of three numbers is at the end of the sensor's range; a range of 0 is not known. */
static bool is_at_end(const double x[3], double range) {
    if (!(range > 0))
        return false;
    for (unsigned i = 0; i < 3; i++)
        if (x[i] >= range || x[i] <= -range)
            return true;
    return false;
}

/* True if a reading differs from the one before by more than readings usually do, and than is possible. */
static bool is_spike(const plr_source *source, const plr_real change2[2]) {
    const uint64_t left_out = source->left_out;
    const plr_real least[2] = {plr_limit(left_out, PLR_LIMIT_SPIKE_ACCEL),
                               plr_limit(left_out, PLR_LIMIT_SPIKE_GYRO)};
    const plr_real times = plr_limit(left_out, PLR_LIMIT_SPIKE_CHANGES);
    if (!source->reading_valid ||
        source->inertial.out_of_line >= plr_limit_count(left_out, PLR_LIMIT_MOST_SPIKES))
        return false;
    for (unsigned i = 0; i < 2; i++)
        if (change2[i] > least[i] * least[i] &&
            change2[i] > times * times * source->inertial.change2[i])
            return true;
    return false;
}

/* What is wrong with a reading by itself and beside the last one; counts repetitions. */
static plr_imu_fault find_fault(plr_filter *f, const plr_imu *imu,
                                const plr_real reading[PLR_POSE_DIM], const plr_real change2[2]) {
    plr_inertial *s = &f->source.inertial;
    if (is_at_end(imu->a_B_mps2, f->config.accel_range_mps2) ||
        is_at_end(imu->w_B_radps, f->config.gyro_range_radps))
        return PLR_IMU_FAULT_SATURATED;
    const bool same = f->source.reading_valid &&
                      memcmp(reading, f->source.reading, sizeof f->source.reading) == 0;
    s->repeated = same ? (uint16_t)(s->repeated + (s->repeated < UINT16_MAX)) : 0;
    if (s->repeated >= plr_limit_count(f->source.left_out, PLR_LIMIT_FROZEN_READINGS))
        return PLR_IMU_FAULT_FROZEN;
    if (is_spike(&f->source, change2)) {
        s->out_of_line++;
        return PLR_IMU_FAULT_SPIKE;
    }
    s->out_of_line = 0;
    return PLR_IMU_FAULT_NONE;
}

plr_status plr_filter_inertial(plr_filter *f, plr_time_ns t_ns, const plr_imu *imu) {
    plr_real reading[PLR_POSE_DIM];
    const plr_status sound = imu ? plr_guard_check_reading(f) : PLR_E_ARGUMENT;
    if (sound != PLR_OK)
        return sound;
    if (f->config.process != PLR_PROCESS_IMU)
        return refuse(f, PLR_E_MODE, PLR_IMU_FAULT_NONE);
    for (unsigned i = 0; i < 3; i++) {
        reading[i] = (plr_real)imu->a_B_mps2[i];
        reading[3 + i] = (plr_real)imu->w_B_radps[i];
    }
    plr_extrinsics_reading_in(f, reading);
    if (!plr_all_finite(imu->a_B_mps2, 3) || !plr_all_finite(imu->w_B_radps, 3))
        return refuse(f, PLR_E_NOT_FINITE, PLR_IMU_FAULT_NOT_FINITE);
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        if (!plr_is_finite(reading[i]))
            return refuse(f, PLR_E_RANGE, PLR_IMU_FAULT_NONE);

    plr_process_step step;
    const plr_status planned = plr_predict_plan(f, t_ns, reading, &step);
    if (planned != PLR_OK || f->config.mode == PLR_MODE_MAPPING)
        return plr_predict_accept(f, t_ns, reading, planned, &step);
    plr_real change2[2];
    plr_statistics_change(&f->source, reading, change2);
    const plr_imu_fault fault = find_fault(f, imu, reading, change2);
    if (fault != PLR_IMU_FAULT_NONE)
        return refuse(f, fault == PLR_IMU_FAULT_FROZEN ? PLR_E_ARGUMENT : PLR_E_RANGE, fault);
    plr_statistics_learn(&f->belief, &f->source, t_ns, reading, step.interval, change2);
    plr_calibration_note_rate(&f->camera, &f->source, reading + 3);
    if (f->source.inertial.phase >= PLR_IMU_UNSETTLED)
        return plr_predict_accept(f, t_ns, reading, planned, &step);
    plr_alignment_add(&f->belief, &f->source, &f->config, t_ns, reading);
    if (f->source.inertial.phase >= PLR_IMU_UNSETTLED)
        plr_filter_store_for_recovery(f);
    const plr_status status = plr_predict_accept(f, t_ns, reading, planned, &step);
    plr_guard_seal_whole(f); /* the start sets P */
    return status;
}

/* ---------------------------------------------------------------- frames and the start */

/* What is expected of a still point's squared way in the picture, px^2: pixels have noise, and tracks have wandered since the stretch began. */
static plr_real still2(const plr_filter *f, const plr_observation *seen) {
    const plr_alignment *at = &f->source.alignment;
    const plr_real seconds = at->count > 0 ? plr_seconds(f->belief.t_ns - at->begin_ns) : PLR_R(0);
    return PLR_R(4) * plr_stereo_pixel_variance(&f->camera, seen) +
           PLR_R(2) * f->camera.track_drift_variance * seconds;
}

/* The watched point of this id, or a free place for it; NULL if there is none. */
static plr_watched_point *watched(plr_alignment *at, uint32_t id) {
    plr_watched_point *free = NULL;
    for (unsigned i = 0; i < PLR_WATCHED_POINTS; i++) {
        if (at->points[i].used && at->points[i].id == id)
            return &at->points[i];
        if (!at->points[i].used && !free)
            free = &at->points[i];
    }
    return free;
}

static void remember(plr_watched_point *point, const plr_observation *seen, bool early) {
    point->used = PLR_POINT_FILLED | (early ? PLR_POINT_EARLY : 0U);
    point->id = seen->id;
    point->u_px = seen->uL_px;
    point->v_px = seen->vL_px;
}

/* True if a watched point is seen at another place for the second time in a row: any match can be wrong,
 * the first one too. */
static bool has_moved(const plr_filter *f, plr_watched_point *point, const plr_observation *seen,
                      bool early) {
    const plr_real du = (plr_real)(seen->uL_px - point->u_px);
    const plr_real dv = (plr_real)(seen->vL_px - point->v_px);
    const bool elsewhere =
        du * du + dv * dv > plr_limit(f->source.left_out, PLR_LIMIT_POINT_MOVED) * still2(f, seen);
    const bool again = elsewhere && (point->used & PLR_POINT_MOVED);
    if (elsewhere && !(point->used & PLR_POINT_CONFIRMED))
        remember(point, seen, early);
    if (elsewhere)
        point->used |= PLR_POINT_MOVED;
    else
        point->used = (point->used & ~(uint32_t)PLR_POINT_MOVED) | PLR_POINT_CONFIRMED |
                      (early ? 0U : (uint32_t)PLR_POINT_STAYS);
    return again;
}

void plr_filter_watch_start(plr_filter *f, const plr_sightings *sightings) {
    unsigned seen = 0, moved = 0;
    const bool early = plr_alignment_is_early(&f->source.alignment, f->belief.t_ns);
    for (unsigned k = 0; k < sightings->count; k++) {
        const plr_observation *o = sightings->at[k].seen;
        plr_watched_point *point = watched(&f->source.alignment, o->id);
        if (!point)
            continue;
        if (point->used) {
            seen++;
            moved += has_moved(f, point, o, early);
        } else {
            remember(point, o, early);
        }
    }
    if (seen < PLR_POINTS_LEAST ||
        2 * moved <= seen) /* a few are mismatches, or things that move */
        return;
    f->source.alignment.seen_to_move = 1;
    plr_alignment_restart(&f->source);
    plr_alignment_does_not_stand(&f->source, PLR_IMU_FAULT_MOVES);
}

void plr_filter_follow_start(plr_filter *f, const plr_report *report) {
    if (f->config.process != PLR_PROCESS_IMU)
        return;
    f->source.inertial.frames =
        (uint16_t)(f->source.inertial.frames +
                   (report->used > 0 && f->source.inertial.frames < UINT16_MAX));
    plr_alignment_anchor(&f->belief, &f->motion, &f->source, &f->config);
    plr_alignment_watch_gravity(&f->belief, &f->source);
}

plr_status plr_filter_set_velocity(plr_filter *f, const double v_B_mps[3],
                                   const double variance[3]) {
    plr_real v[3], P_v[3];
    const plr_status sound = v_B_mps && variance ? plr_guard_check_whole(f) : PLR_E_ARGUMENT;
    if (sound != PLR_OK)
        return sound;
    if (f->config.process != PLR_PROCESS_IMU || !f->source.inertial.pose_given ||
        f->belief.count > 0 || f->motion.pending)
        return plr_filter_refuse(f, PLR_E_MODE);
    if (!plr_all_finite(v_B_mps, 3) || !plr_all_finite(variance, 3))
        return plr_filter_refuse(f, PLR_E_NOT_FINITE);
    if (!plr_all_within(v_B_mps, 3, MAX_VELOCITY) || !plr_all_within(variance, 3, PLR_MAX_VARIANCE))
        return plr_filter_refuse(f, PLR_E_RANGE);
    for (unsigned i = 0; i < 3; i++) {
        if (variance[i] < 0)
            return plr_filter_refuse(f, PLR_E_ARGUMENT);
        v[i] = (plr_real)v_B_mps[i];
        P_v[i] = (plr_real)variance[i];
    }
    plr_alignment_given(&f->belief, &f->source, v, P_v);
    plr_filter_store_for_recovery(f);
    plr_guard_seal_whole(f);
    return PLR_OK;
}

plr_imu_fault plr_filter_imu_fault(const plr_filter *f) {
    return f && f->magic == PLR_FILTER_MAGIC && f->source.inertial.fault < PLR_IMU_FAULTS
               ? (plr_imu_fault)f->source.inertial.fault
               : PLR_IMU_FAULT_NONE;
}
