// SPDX-License-Identifier: MIT
#include "supervise/supervise.h"

#include <string.h>

#include "limits/limits.h"
#include "math/dense.h"
#include "math/se3.h"
#include "math/small.h"
#include "supervise/doubt.h"
#include "supervise/health.h"
#include "supervise/map.h"
#include "supervise/odometry.h"
#include "supervise/pictures.h"
#include "supervise/readings.h"

/* Reasons that do not apply in dead reckoning, and those that hold now or not at all. */
#define OF_PICTURES (PLR_REASON_FEW_OBSERVATIONS | PLR_REASON_NO_OBSERVATIONS)
#define OF_NOW      (PLR_REASON_NOT_STARTED | PLR_REASON_IMU_FAULT)

static void forget_frames(plr_supervisor *s) {
    plr_odometry_settle(s);
    plr_odometry_forget(s);
    plr_map_forget(s);
    s->doubt = PLR_DOUBT_NONE;
    s->settle_frames = s->relocated = s->frozen = 0;
    s->agreeing_frames = s->doubted_frames = 0;
    s->frames_without_use = s->frames_mostly_gated = 0;
    s->nis = s->nis_dof = 0;
}

void plr_supervise_begin(plr_supervisor *s, const plr_config *config) {
    const uint64_t left_out = s->left_out;
    memset(s, 0, sizeof *s);
    s->left_out = left_out;
    s->scene = config->scene;
    s->slips = config->process == PLR_PROCESS_TWIST;
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        s->usual[k] = 1;
    forget_frames(s);
    plr_sensors_forget(s);
    s->health = PLR_HEALTH_DEGRADED; /* nothing has been seen yet */
    s->reasons = PLR_REASON_FEW_OBSERVATIONS;
    plr_supervise_clock_set(s);
}

/* The pose may be wrong, until pictures and odometry have agreed. */
static void lose(plr_supervisor *s) {
    plr_doubt_change(s, PLR_DOUBT_LOSES);
    s->settle_frames = (uint8_t)plr_limit_count(s->left_out, PLR_LIMIT_SETTLED_FRAMES);
}

/* ---------------------------------------------------------------- the three points of a frame */

static plr_picture_decision decide_on_picture(const plr_supervisor *s, bool use) {
    return (plr_picture_decision){.use = use,
                                  .weight = s->weight,
                                  .may_exclude_odometry = plr_odometry_has_before(s),
                                  .opens_fixed_gate = plr_pictures_open_fixed_gate(s)};
}

plr_picture_decision plr_supervise_picture(plr_supervisor *s, const plr_picture_evidence *e) {
    return decide_on_picture(s, !e->may_repeat || plr_pictures_show_present(s, e));
}

/* True if points have excluded the odometry for long enough to be followed: twists for one frame; an IMU for as long
 * as it takes far points, which have no part in a motion near the camera, to tell it from that of the body. */
static bool is_confirmed(const plr_supervisor *s, plr_time_ns now_ns) {
    if (s->slips)
        return s->outright || plr_limit_count(s->left_out, PLR_LIMIT_CONFIRMED) == 0;
    const double since_s = 1e-9 * (double)(now_ns - s->outright_ns);
    return since_s >= (double)plr_limit(s->left_out, PLR_LIMIT_CONFIRMED_S);
}

plr_search_decision plr_supervise_search(plr_supervisor *s, const plr_search_evidence *e) {
    plr_search_decision decision = {false, false, false, false};
    if (e->outright && !s->outright)
        s->outright_ns = e->now_ns;
    decision.wait = e->outright && !plr_doubt_contradicted(s) && !is_confirmed(s, e->now_ns);
    /* a frame that rejects nearly all, or repeats the last, neither confirms nor denies */
    const bool denies = !s->frozen && !plr_pictures_reject_all(s, e->matched, e->gated);
    s->outright = e->outright || (s->outright && !denies);
    s->waits = decision.wait;
    s->holds_biases = 0;
    if (decision.wait) {
        decision.make_none = true;
        return decision;
    }
    decision.hold_biases =
        e->outright || plr_doubt_contradicted(s) ||
        (s->doubted_frames > 0 &&
         s->doubted_frames < plr_limit_count(s->left_out, PLR_LIMIT_HELD_FRAMES));
    decision.drop_rejected = plr_pictures_lock(s, e->matched, e->gated);
    decision.make_none = s->frames_mostly_gated > 0 && !decision.drop_rejected;
    s->holds_biases = decision.hold_biases;
    return decision;
}

/* If prior and noise are as stated, an estimate differs from the mean of its prior by N(0, P_0 - P), with
 * P_0 the prior's variance and the walk's since: by less than the prior's sigma as long as little has been
 * learnt. */
static bool bias_is_off(const plr_supervisor *s, const plr_bias_evidence *b) {
    const plr_real sigmas = plr_limit(s->left_out, PLR_LIMIT_BIAS_SIGMAS);
    for (unsigned k = 0; k < PLR_BIAS_DIM && b->estimated; k++) {
        const plr_real learnt = b->prior[k] - b->variance[k];
        if (b->prior[k] > 0 &&
            learnt > plr_limit(s->left_out, PLR_LIMIT_BIAS_LEARNT) * b->prior[k] &&
            b->off[k] * b->off[k] > sigmas * sigmas * learnt)
            return true;
    }
    return false;
}

static uint32_t reasons_of_events(const plr_frame_events *events, const plr_report *report) {
    uint32_t reasons = 0;
    if (report->blocks_failed)
        reasons |= PLR_REASON_BLOCK_FAILED;
    if (events->sink_failed)
        reasons |= PLR_REASON_SINK_FAILED;
    if (report->no_room)
        reasons |= PLR_REASON_NO_ROOM;
    if (report->refused || report->duplicates)
        reasons |= PLR_REASON_REFUSED_INPUT;
    if (events->cut)
        reasons |= PLR_REASON_RANGE_LIMITED;
    if (report->left_out)
        reasons |= PLR_REASON_BUDGET;
    if (events->recovered)
        reasons |= PLR_REASON_NOT_POSITIVE | PLR_REASON_RECOVERED;
    if (events->relocated)
        reasons |= PLR_REASON_RELOCATED;
    if (events->miscalibrated)
        reasons |= PLR_REASON_CALIBRATION_OFF;
    return reasons;
}

/* The map's part: what it moved the pose by is covered, and the pose in doubt. */
static uint32_t hear_map(plr_supervisor *s, const plr_frame_evidence *e) {
    plr_map_verdict map;
    if (e->events.moved_far)
        plr_odometry_differs(s, e->events.far_xi, e->events.far_nu, PLR_POSE_DIM);
    plr_map_add(s, &e->map, &map);
    if (map.disagrees)
        plr_odometry_differs(s, map.n, map.nu, map.noise);
    if (e->events.moved_far || map.disagrees || e->events.lost_in_map)
        lose(s);
    return e->events.moved_far || map.disagrees ? PLR_REASON_MAP_DISAGREES : 0;
}

/* The frame's one event of the doubt, the weightiest first. */
static void change_doubt(plr_supervisor *s, const plr_odometry_verdict *o, bool lost) {
    const uint8_t settled = (uint8_t)plr_limit_count(s->left_out, PLR_LIMIT_SETTLED_FRAMES);
    if (o->contradicts) {
        plr_doubt_change(s, PLR_DOUBT_CONTRADICTS);
        s->settle_frames = settled;
    } else if (o->departs) {
        plr_doubt_change(s, PLR_DOUBT_DEPARTS);
        if (s->doubt == PLR_DOUBT_DEPARTED && s->settle_frames < settled)
            s->settle_frames++; /* as long as it lasted, so that noise is soon forgotten */
    } else if (s->statistic < plr_limit(s->left_out, PLR_LIMIT_AGREES_BELOW)) {
        plr_doubt_change(s, PLR_DOUBT_RETURNS);
    }
    if (lost || plr_pictures_misled(s))
        lose(s);
}

/* Both have agreed for long enough: what lies between their poses is added to P. */
static void settle(plr_supervisor *s, plr_frame_decision *decision) {
    decision->covers = plr_norm2_of_6(s->difference) > 0;
    if (decision->covers)
        plr_odometry_cover(s, s->difference, decision->cover);
    s->settled = 1;
    plr_odometry_settle(s);
    plr_doubt_change(s, PLR_DOUBT_SETTLES);
    s->settle_frames = s->relocated = 0;
    s->agreeing_frames = s->doubted_frames = 0;
}

static void count_doubt(plr_supervisor *s, bool lost, const plr_report *report) {
    const bool event = lost || plr_pictures_misled(s) || plr_doubt_contradicted(s);
    const bool agrees = !lost && !s->frozen && s->doubt != PLR_DOUBT_DEPARTED && !s->outright &&
                        report->used >= plr_limit_count(s->left_out, PLR_LIMIT_FEW) &&
                        s->statistic < plr_limit(s->left_out, PLR_LIMIT_AGREES_BELOW);
    if ((event || s->doubted_frames > 0) && s->doubted_frames < UINT16_MAX)
        s->doubted_frames++;
    s->agreeing_frames =
        agrees ? (uint16_t)(s->agreeing_frames + (s->agreeing_frames < UINT16_MAX)) : 0;
}

static uint32_t reasons_of_doubt(const plr_supervisor *s) {
    const bool differs = s->outright || plr_doubt_contradicted(s) ||
                         s->statistic > plr_limit(s->left_out, PLR_LIMIT_DEPARTS_ABOVE) ||
                         s->doubt == PLR_DOUBT_DEPARTED;
    return (differs ? PLR_REASON_TWIST_CONTRADICTED : 0U) |
           (s->doubt != PLR_DOUBT_NONE ? PLR_REASON_POSE_MAY_BE_WRONG : 0U) |
           (s->misfits ? PLR_REASON_NOISE_MISFIT : 0U);
}

void plr_supervise_frame(plr_supervisor *s, const plr_frame_evidence *e, const plr_report *report,
                         plr_frame_decision *decision) {
    const bool held = plr_health_readings_are_old(s, &e->readings);
    const bool was_contradicted = plr_doubt_contradicted(s);
    const bool tells = !held && s->frames_without_use == 0 &&
                       report->used >= plr_limit_count(s->left_out, PLR_LIMIT_FEW);
    plr_odometry_verdict odometry = {false, false, 0};
    uint32_t reasons = reasons_of_events(&e->events, report);
    memset(decision, 0, sizeof *decision);
    if (e->motion.applied)
        odometry = plr_odometry_add(s, &e->motion, held, tells);
    reasons |= hear_map(s, e);
    reasons |= plr_pictures_add(s, report, e->readings.now_ns, e->has_gate);
    reasons |= plr_health_of_readings(s, &e->readings);
    if (e->events.locked)
        reasons |= PLR_REASON_GATE_LOCKED;
    if (bias_is_off(s, &e->bias))
        reasons |= PLR_REASON_BIAS_OFF_PRIOR;
    const uint32_t lost_by = plr_health_lost_by(s, e->readings.now_ns);
    const bool lost = (reasons & lost_by) != 0;
    change_doubt(s, &odometry, lost);
    decision->contradicted_now = odometry.contradicts && (e->motion.outright || !was_contradicted);
    count_doubt(s, lost, report);
    s->settled = 0;
    if (s->doubt != PLR_DOUBT_NONE && s->agreeing_frames >= s->settle_frames)
        settle(s, decision);
    if (e->motion.applied)
        plr_odometry_weigh(s, odometry.excess);
    reasons |= reasons_of_doubt(s);
    s->refused_before = e->readings.refused;
    s->last_frame_ns = e->readings.now_ns;
    if (report->used > 0)
        s->last_use_ns = e->readings.now_ns;
    decision->reasons = s->reasons = reasons;
    decision->health = plr_health_of(reasons, lost_by);
    s->health = (uint8_t)decision->health;
}

/* ---------------------------------------------------------------- between frames */

void plr_supervise_pose_set(plr_supervisor *s) {
    forget_frames(s);
}

plr_picture_decision plr_supervise_begun_anew(plr_supervisor *s, bool relocated) {
    forget_frames(s);
    lose(s);
    s->relocated = relocated;
    return decide_on_picture(s, true);
}

void plr_supervise_reading(plr_supervisor *s, const plr_reading *reading, unsigned numbers,
                           bool used, plr_real d2, bool bounds, plr_time_ns now_ns) {
    plr_sensors_add(s, reading, numbers, used, d2);
    if (used && bounds)
        s->last_position_ns = now_ns;
}

void plr_supervise_restored(plr_supervisor *s) {
    plr_sensors_forget(s);
    s->last_position_ns = PLR_NEVER_NS;
}

/* ---------------------------------------------------------------- what is reported */

void plr_supervise_enlarge(const plr_supervisor *s, const plr_real E[9], const plr_real p[3],
                           plr_real P_xi[PLR_POSE_SQUARE]) {
    plr_real R[9], A[PLR_POSE_SQUARE], d[PLR_POSE_DIM], C[PLR_POSE_SQUARE];
    if (!(plr_norm2_of_6(s->difference) > 0))
        return;
    plr_se3_rotation(R, E);
    plr_se3_adjoint_inverse(A, R, p);
    plr_mat6_vec(d, A, s->difference);
    plr_odometry_cover(s, d, C);
    for (unsigned i = 0; i < PLR_POSE_SQUARE; i++)
        P_xi[i] += C[i];
}

static void copy(float *to, const plr_real *from, unsigned n) {
    for (unsigned i = 0; i < n; i++)
        to[i] = (float)from[i];
}

void plr_supervise_tell(const plr_supervisor *s, const plr_frame_evidence *e,
                        plr_supervision *told) {
    const plr_motion_evidence *m = &e->motion;
    memset(told, 0, sizeof *told);
    if (m->applied) {
        copy(told->nu, m->nu, PLR_POSE_DIM);
        copy(told->moved, m->moved, PLR_POSE_DIM);
    }
    told->t_ns = s->last_frame_ns;
    told->statistic = (float)s->statistic;
    copy(told->usual, s->usual, PLR_POSE_DIM);
    told->agreement = (float)s->agreement;
    told->weight = (float)s->weight;
    copy(told->difference, s->difference, PLR_POSE_DIM);
    told->doubt = s->doubt;
    told->applied = m->applied;
    told->outright = s->outright;
    told->waits = s->waits;
    told->holds_biases = s->holds_biases;
    told->locked = e->events.locked;
    told->frozen = s->frozen;
    told->misfits = s->misfits;
    told->settled = s->settled;
    told->matched = (uint16_t)e->picture.matched;
    told->same = (uint16_t)e->picture.same;
    told->known = (uint16_t)e->map.known;
    told->adopted = (uint16_t)e->events.adopted;
}

void plr_supervise_health(const plr_supervisor *s, const plr_readings_evidence *now,
                          plr_health_state *health) {
    health->reasons = s->reasons & ~(uint32_t)(now->looks ? OF_NOW : OF_NOW | OF_PICTURES);
    plr_health_ages(s, now, health);
    const double lost_s = (double)plr_limit(s->left_out, PLR_LIMIT_LOST_S);
    if (now->looks && health->seconds_without_frame > lost_s)
        health->reasons |= PLR_REASON_NO_FRAMES;
    if (now->looks && health->seconds_without_use > lost_s)
        health->reasons |= PLR_REASON_NO_OBSERVATIONS;
    health->reasons |= plr_health_of_readings(s, now);
    health->health = plr_health_of(health->reasons, plr_health_lost_by(s, now->now_ns));
}

void plr_supervise_waits(plr_supervisor *s, const plr_readings_evidence *now, plr_report *report) {
    report->reasons = plr_health_of_readings(s, now) & ~(uint32_t)PLR_REASON_READINGS_REJECTED;
    report->health = PLR_HEALTH_LOST;
    s->refused_before = now->refused;
    s->last_frame_ns = now->now_ns;
    s->health = (uint8_t)report->health;
    s->reasons = report->reasons;
}

void plr_supervise_refused(const plr_supervisor *s, plr_report *report) {
    report->health = s->health == PLR_HEALTH_GOOD ? PLR_HEALTH_DEGRADED : (plr_health)s->health;
    report->reasons = s->reasons;
}

void plr_supervise_dead_reckons(plr_supervisor *s, const plr_readings_evidence *now) {
    s->reasons = (s->reasons & OF_PICTURES) |
                 (plr_health_of_readings(s, now) & (uint32_t)PLR_REASON_NO_TWISTS);
    s->refused_before = now->refused;
    s->health = (uint8_t)plr_health_of(s->reasons & ~(uint32_t)OF_PICTURES,
                                       plr_health_lost_by(s, now->now_ns));
}
