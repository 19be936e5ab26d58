// SPDX-License-Identifier: MIT
#include "filter/relocate.h"

#include <string.h>

#include "filter/correction.h"
#include "filter/filter_internal.h"
#include "filter/gate.h"
#include "filter/predict.h"
#include "known_map/find.h"
#include "known_map/lookup.h"
#include "limits/limits.h"
#include "math/dense.h"
#include "math/small.h"
#include "process/alignment.h"
#include "sensor/stereo.h"
#include "state/covariance.h"
#include "state/model.h"
#include "state/motion.h"
#include "state/pose.h"
#include "state/sightings.h"
#include "supervise/supervise.h"

/* The pose's variance before the update, as a multiple of the one by which the frame tells the
 * pose. The update uses the frame again, because it makes the correlations between pose and
 * landmarks, and the frame is counted twice by a hundredth then. */
#define WIDER PLR_R(100)

/* A step towards a pose is exact to first order, so it takes some. */
enum { STEPS = 3 };
/* Known landmarks that come in again tell the pose a second time. That is allowed only where the
 * frame alone tells it better than all before: where each variance of the pose is at least this
 * multiple of the frame's. */
#define WIDE_ENOUGH PLR_R(1)

static unsigned off_frames(const plr_filter *f) {
    return plr_limit_count(plr_supervise_left_out(&f->supervisor), PLR_LIMIT_OFF_MAP_FRAMES);
}

void plr_relocate_watch(plr_filter *f, const plr_sightings *sightings, unsigned unplaced) {
    unsigned seen = unplaced, off = unplaced;
    if (!plr_map_is_asked(&f->config, &f->map))
        return;
    for (unsigned k = 0; k < sightings->count; k++) {
        const plr_sighting *row = &sightings->at[k];
        if (!plr_is_of_known(&f->belief, row))
            continue;
        seen++;
        off += !plr_gate_accepted(row);
    }
    if (seen < 2)
        return; /* says nothing */
    if (5 * off < 4 * seen)
        f->frames_off_the_map = 0;
    else if (f->frames_off_the_map < off_frames(f))
        f->frames_off_the_map++;
}

/* ---------------------------------------------------------------- lost */

/* Takes up the landmarks that agree; the others come in with the next frame. */
static void take_up(plr_filter *f, const plr_sightings *sightings, const plr_seen_known *seen,
                    unsigned count) {
    for (unsigned i = 0; i < count; i++) {
        const uint32_t id = sightings->at[seen[i].k].seen->id;
        plr_landmark known;
        plr_new_landmark landmark;
        if (seen[i].agrees && f->belief.count < f->config.slots &&
            plr_map_ask(&f->map, id, &known) &&
            plr_model_of(&f->belief)->adopt(&f->belief, &f->camera, &f->motion, &known, &landmark))
            plr_slots_append(&f->belief, id, true, &landmark);
    }
}

static plr_picture_decision begin_at(plr_filter *f, const plr_sightings *sightings,
                                     const plr_found_pose *found) {
    const bool again = plr_supervise_was_relocated(&f->supervisor);
    plr_real P[PLR_POSE_SQUARE];
    memcpy(f->belief.R_WB, found->R_WB, sizeof f->belief.R_WB);
    memcpy(f->belief.p_WB, found->p_WB, sizeof f->belief.p_WB);
    for (unsigned i = 0; i < PLR_POSE_SQUARE; i++)
        P[i] = WIDER * found->P_xi[i];
    const plr_picture_decision decided = plr_filter_begin_anew(f, P, true);
    if (again && f->config.process == PLR_PROCESS_IMU) /* wrong biases lead away from each pose */
        plr_filter_begin_prior_bias(f, 4);
    plr_alignment_keep_world(&f->source);
    take_up(f, sightings, plr_seen_known_of(f->work.Vt), found->count);
    return decided;
}

bool plr_relocate_when_lost(plr_filter *f, const plr_sightings *sightings, plr_frame_events *events,
                            plr_picture_decision *decided) {
    plr_found_pose found;
    if (f->frames_off_the_map < off_frames(f) || !plr_map_is_asked(&f->config, &f->map))
        return false;
    f->frames_off_the_map = 0;
    events->lost_in_map =
        !plr_find_pose(&f->belief, &f->camera, &f->map, f->work.Vt, sightings, false, &found);
    if (events->lost_in_map)
        return false;
    *decided = begin_at(f, sightings, &found);
    return true;
}

/* ---------------------------------------------------------------- uncertain */

/* True if the direction in which a point is seen from range r is so uncertain that it is not
 * linear in the error. C: covariance of the body's motion. */
static bool is_uncertain(const plr_filter *f, const plr_real C[PLR_POSE_SQUARE], plr_real r2) {
    plr_real way = 0, turn = 0;
    for (unsigned i = 0; i < 3; i++) {
        way += C[(PLR_POSE_DIM + 1) * i];
        turn += C[(PLR_POSE_DIM + 1) * (3 + i)];
    }
    return way + turn * r2 > 2 * plr_stereo_max_bearing_variance(&f->camera) * r2;
}

static bool slot_is_uncertain(const plr_filter *f, const plr_real C[PLR_POSE_SQUARE],
                              unsigned slot) {
    const plr_slot *s = &f->belief.slots[slot];
    return s->known && is_uncertain(f, C, plr_dot3(s->x, s->x));
}

/* Known landmarks that the caller has inserted stay: they would not come in again. */
static bool is_in_map(const plr_filter *f, unsigned slot) {
    plr_landmark known;
    return f->belief.slots[slot].known && plr_map_ask(&f->map, f->belief.slots[slot].id, &known);
}

void plr_relocate_let_go(plr_filter *f, const plr_real C[PLR_POSE_SQUARE]) {
    if (f->config.model != PLR_MODEL_BODY || !plr_map_is_asked(&f->config, &f->map))
        return;
    for (unsigned slot = f->belief.count; slot-- > 0;) /* backwards: removing moves the last */
        if (slot_is_uncertain(f, C, slot) && is_in_map(f, slot))
            plr_slots_remove(&f->belief, slot);
}

/* How many known landmarks in sight are too uncertain: by the pose if they have just come in
 * (`new_ones`), else by the motion since the last frame. */
static unsigned count_uncertain(const plr_filter *f, const plr_sightings *sightings,
                                unsigned *new_ones) {
    plr_real P_xi[PLR_POSE_SQUARE], motion[PLR_POSE_SQUARE];
    unsigned uncertain = 0;
    *new_ones = 0;
    plr_motion_pose_covariance(&f->belief, &f->motion, P_xi);
    plr_motion_covariance_by_state(&f->belief, &f->motion, motion);
    for (unsigned i = 0; i < PLR_POSE_SQUARE; i++)
        motion[i] += f->motion.Q[i];
    for (unsigned k = 0; k < sightings->count; k++) {
        const unsigned slot = sightings->at[k].slot;
        if (!plr_is_of_known(&f->belief, &sightings->at[k]))
            continue;
        const bool is_new = plr_has_just_come_in(&f->belief, slot);
        const bool is = slot_is_uncertain(f, is_new ? P_xi : motion, slot);
        uncertain += is;
        *new_ones += is && is_new && is_in_map(f, slot);
    }
    return uncertain;
}

/* They come in again: all known landmarks, or those that have just come in. */
static void drop_known(plr_filter *f, bool new_ones_alone) {
    for (unsigned slot = f->belief.count; slot-- > 0;) /* backwards: removing moves the last */
        if ((!new_ones_alone || plr_has_just_come_in(&f->belief, slot)) && is_in_map(f, slot))
            plr_slots_remove(&f->belief, slot);
}

/* Moves the pose to where prediction and frame together have it: to the one that was found, less
 * what the prediction knows better. */
static plr_status move_to(plr_filter *f, const plr_found_pose *found, const plr_pose_gap *gap) {
    plr_status status = PLR_OK;
    for (unsigned step = 0; step < STEPS && status == PLR_OK; step++) {
        plr_real xi[PLR_POSE_DIM];
        plr_pose_towards(&f->belief, found->R_WB, found->p_WB, xi);
        for (unsigned k = 0; k < PLR_POSE_DIM; k++)
            xi[k] -= gap->back[k];
        status = plr_correct_towards(f, xi);
    }
    return status;
}

/* The pose that was found, with the covariance P. Velocity, biases and landmarks keep what they
 * know, but not what they have in common with the pose. */
static void replace_pose(plr_filter *f, const plr_found_pose *found,
                         const plr_real P[PLR_POSE_SQUARE]) {
    static const plr_real none[PLR_POSE_DIM] = {0};
    memcpy(f->belief.R_WB, found->R_WB, sizeof f->belief.R_WB);
    memcpy(f->belief.p_WB, found->p_WB, sizeof f->belief.p_WB);
    plr_covariance_forget(&f->belief, PLR_BLOCK_POSE, none);
    plr_covariance_add(&f->belief, PLR_BLOCK_POSE, P);
}

static bool is_far(const plr_filter *f, const plr_pose_gap *gap) {
    return plr_norm2_of_6(gap->nu) >
           plr_limit(plr_supervise_left_out(&f->supervisor), PLR_LIMIT_MOVED_FAR);
}

/* Moves to the pose that was found, by which the landmarks come in. If it is too far, what was
 * believed of the pose was wrong, and tells nothing of biases and velocity. P_wide: of a pose that
 * replaces the present one. */
static plr_status go_to(plr_filter *f, const plr_found_pose *found, const plr_pose_gap *gap,
                        bool replaces, const plr_real P_wide[PLR_POSE_SQUARE],
                        plr_frame_events *events) {
    if (!replaces && !is_far(f, gap))
        return move_to(f, found, gap);
    replace_pose(f, found, P_wide);
    if (!is_far(f, gap))
        return PLR_OK;
    f->totals.widened++;
    events->moved_far = true;
    memcpy(events->far_xi, gap->xi, sizeof events->far_xi);
    memcpy(events->far_nu, gap->nu, sizeof events->far_nu);
    return PLR_OK;
}

/* False of a pose that is known exactly along an axis: there is no moving it. */
static bool is_regular(const plr_real P[PLR_POSE_SQUARE]) {
    plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN];
    plr_upper6_pack(U, P);
    return plr_cholesky_upper(PLR_POSE_DIM, U);
}

/* Where the frame tells more of the pose than was known. */
static bool is_told_by_frame(plr_filter *f, const plr_sightings *sightings, plr_found_pose *found,
                             plr_pose_gap *gap) {
    return plr_find_pose(&f->belief, &f->camera, &f->map, f->work.Vt, sightings, true, found) &&
           plr_find_gap(&f->belief, &f->camera, &f->motion, found, gap) &&
           !(gap->least < WIDE_ENOUGH);
}

plr_status plr_relocate_when_uncertain(plr_filter *f, const plr_sightings *sightings,
                                       plr_frame_events *events, plr_relocation *what) {
    plr_found_pose found;
    plr_pose_gap gap;
    plr_real P[PLR_POSE_SQUARE];
    unsigned new_ones;
    plr_status status;
    *what = PLR_PLACED;
    if (f->config.model != PLR_MODEL_BODY || !plr_map_is_asked(&f->config, &f->map))
        return PLR_OK;
    const unsigned uncertain = count_uncertain(f, sightings, &new_ones);
    if (uncertain >= PLR_PLACING_LEAST && is_told_by_frame(f, sightings, &found, &gap)) {
        for (unsigned i = 0; i < PLR_POSE_SQUARE; i++)
            P[i] = WIDER * found.P_xi[i];
        drop_known(f, false);
        *what = PLR_MOVED;
        status = plr_predict_apply_prior(f);
        return status != PLR_OK ? status
                                : go_to(f, &found, &gap, gap.largest > PLR_TOO_WIDE, P, events);
    }
    plr_motion_pose_covariance(&f->belief, &f->motion, P);
    if (new_ones == 0 || !is_regular(P))
        return PLR_OK;
    const bool tells = plr_find_likeliest_pose(&f->belief, &f->camera, &f->motion, &f->map,
                                               f->work.Vt, sightings, &found) &&
                       plr_find_gap(&f->belief, &f->camera, &f->motion, &found, &gap);
    drop_known(f, true);
    events->lost_in_map = !tells;
    *what = tells ? PLR_MOVED : PLR_LEFT_OUT;
    if (!tells)
        return PLR_OK;
    status = plr_predict_apply_prior(f);
    return status != PLR_OK ? status : go_to(f, &found, &gap, false, P, events);
}
