// SPDX-License-Identifier: MIT
/*
 * The supervisor as the estimator sees it: asked at three points of a frame, told of what happens between
 * frames. Its functions change its own state alone. src/absent/supervise.c answers in its place where it is
 * left out of a build (PLR_SUPERVISE=0).
 */
#ifndef PLR_SUPERVISE_SUPERVISE_H
#define PLR_SUPERVISE_SUPERVISE_H

#include <string.h>

#include "pelorus/settings.h"
#include "pelorus/supervisor.h"

/* Nothing has been seen. */
void plr_supervise_begin(plr_supervisor *s, const plr_config *config);

/* ---------------------------------------------------------------- the three points of a frame */

/* Before the search. */
plr_picture_decision plr_supervise_picture(plr_supervisor *s, const plr_picture_evidence *e);

/* After search and gate. */
plr_search_decision plr_supervise_search(plr_supervisor *s, const plr_search_evidence *e);

/* At the end. */
void plr_supervise_frame(plr_supervisor *s, const plr_frame_evidence *e, const plr_report *report,
                         plr_frame_decision *decision);

/* ---------------------------------------------------------------- between frames */

/* The pose was set: what was summed up belongs to another. */
void plr_supervise_pose_set(plr_supervisor *s);

/* The filter has begun anew at the present pose: it is in doubt. Within a frame the answer takes the place of
 * the first one. */
plr_picture_decision plr_supervise_begun_anew(plr_supervisor *s, bool relocated);

/* True if the pose was found anew and has been in doubt since. */
static inline bool plr_supervise_was_relocated(const plr_supervisor *s) {
    return s->relocated;
}

/* The clock was interrupted: no time of before counts. */
static inline void plr_supervise_clock_set(plr_supervisor *s) {
    s->last_frame_ns = s->last_use_ns = s->last_position_ns = PLR_NEVER_NS;
}

/* It was set to t_ns: the same, if the last frame is not within the gap before it. */
static inline void plr_supervise_clock_set_to(plr_supervisor *s, plr_time_ns t_ns,
                                              plr_time_ns max_gap_ns) {
    if (s->last_frame_ns > t_ns || t_ns - s->last_frame_ns > max_gap_ns)
        plr_supervise_clock_set(s);
}

/* When the last frame was, or PLR_NEVER_NS. */
static inline plr_time_ns plr_supervise_last_frame_ns(const plr_supervisor *s) {
    return s->last_frame_ns;
}

/* The pending motion is applied without a frame. */
void plr_supervise_moved(plr_supervisor *s, const plr_picture_evidence *e);

/* A small sensor's reading that was used or rejected; its position bounds the pose if `bounds`. */
void plr_supervise_reading(plr_supervisor *s, const plr_reading *reading, unsigned numbers,
                           bool used, plr_real d2, bool bounds, plr_time_ns now_ns);

/* By how much the variance of the sensor's readings is larger than stated, 1 or more: what they differ
 * from the estimate by says so while they are off. */
plr_real plr_supervise_widening(const plr_supervisor *s, unsigned sensor);

/* True if a reading is the sensor's last one again, of the same time: it says nothing new. */
static inline bool plr_supervise_repeats(const plr_supervisor *s, const plr_reading *reading) {
    const plr_sensor_record *of = &s->sensors[reading->sensor - 1];
    return of->t_ns == reading->t_ns && memcmp(of->value, reading->value, sizeof of->value) == 0;
}

/* After a restore: small sensors and positions of before do not count. */
void plr_supervise_restored(plr_supervisor *s);

/* ---------------------------------------------------------------- what is reported */

/* Adds to a reported covariance of the pose, 6x6, what is in doubt. (I + E, p) is the motion since the last
 * frame. */
void plr_supervise_enlarge(const plr_supervisor *s, const plr_real E[9], const plr_real p[3],
                           plr_real P_xi[PLR_POSE_SQUARE]);

/* True unless the last frame missed twists or readings of an IMU. */
static inline bool plr_supervise_has_readings(const plr_supervisor *s) {
    return !(s->reasons & PLR_REASON_NO_TWISTS);
}

/* For measurements: the rules that are left out from now on, bits of plr_limit_id; and those that are. */
static inline void plr_supervise_leave_out(plr_supervisor *s, uint64_t limits) {
    s->left_out = limits;
}

static inline uint64_t plr_supervise_left_out(const plr_supervisor *s) {
    return s->left_out;
}

/* What was seen in the last frame, and decided; the rejected landmarks are not filled. */
void plr_supervise_tell(const plr_supervisor *s, const plr_frame_evidence *e,
                        plr_supervision *told);

/* Health and reasons at any time. */
void plr_supervise_health(const plr_supervisor *s, const plr_readings_evidence *now,
                          plr_health_state *health);

/* Health and reasons of a frame that came before an IMU's start, of one that was refused, and of one of
 * dead reckoning. */
void plr_supervise_waits(plr_supervisor *s, const plr_readings_evidence *now, plr_report *report);
void plr_supervise_refused(const plr_supervisor *s, plr_report *report);
void plr_supervise_dead_reckons(plr_supervisor *s, const plr_readings_evidence *now);

#endif
