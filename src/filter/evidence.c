// SPDX-License-Identifier: MIT
#include "filter/evidence.h"

#include <string.h>

#include "filter/filter_internal.h"
#include "filter/gate.h"
#include "filter/guard.h"
#include "math/dense.h"
#include "math/small.h"
#include "process/process.h"
#include "state/blocks.h"
#include "state/calibration.h"
#include "state/covariance.h"
#include "state/pose.h"
#include "state/sensitivity.h"
#include "state/sightings.h"
#include "supervise/supervise.h"

/* A hash of an observation's four pixel coordinates. */
static uint32_t hash_of_pixels(const plr_observation *o) {
    const float pixels[4] = {o->uL_px, o->vL_px, o->uR_px, o->vR_px};
    uint32_t hash = 2166136261U;
    for (unsigned i = 0; i < 4; i++) {
        uint32_t bits;
        memcpy(&bits, &pixels[i], sizeof bits);
        hash = (hash ^ bits) * 16777619U;
        hash ^= hash >> 15;
    }
    return hash;
}

void plr_evidence_of_picture(plr_filter *f, const plr_sightings *sightings) {
    plr_picture_evidence *e = &f->evidence.picture;
    e->may_repeat = f->config.model == PLR_MODEL_BODY;
    for (unsigned k = 0; k < sightings->count; k++) {
        const plr_sighting *row = &sightings->at[k];
        if (!plr_is_matched(row))
            continue;
        plr_slot *slot = plr_slot_of(&f->belief, row);
        const uint32_t hash = hash_of_pixels(row->seen);
        e->matched++;
        e->same += slot->pixel_hash == hash;
        slot->pixel_hash = hash;
    }
    plr_filter_pending_motion(f, e);
}

void plr_evidence_note_pose(const plr_filter *f, plr_evidence_pose *pose) {
    memcpy(pose->R_WB, f->belief.R_WB, sizeof pose->R_WB);
    memcpy(pose->p_WB, f->belief.p_WB, sizeof pose->p_WB);
}

void plr_evidence_of_motion(plr_filter *f, const plr_evidence_pose *by_odometry,
                            const plr_applied_motion *stated, plr_real weight,
                            const plr_motion_first *first, const plr_correction *correction) {
    plr_motion_evidence *e = &f->evidence.motion;
    e->applied = true;
    e->outright = first->outright;
    memcpy(e->E, first->motion.E, sizeof e->E);
    memcpy(e->p, first->motion.p, sizeof e->p);
    memcpy(e->L, stated->L, sizeof e->L);
    e->weight = weight;
    plr_mat6_vec(e->nu, first->motion.L, correction->nu);
    plr_motion_solve(stated->L, 1, e->nu, 1);
    memcpy(e->Lambda, correction->Lambda, sizeof e->Lambda);
    plr_pose_moved_from(&f->belief, by_odometry->R_WB, by_odometry->p_WB, e->moved);
}

bool plr_evidence_before_map(plr_filter *f, const plr_sightings *sightings,
                             plr_evidence_pose *before) {
    plr_map_evidence *e = &f->evidence.map;
    for (unsigned k = 0; k < sightings->count; k++)
        e->known += plr_is_of_known(&f->belief, &sightings->at[k]);
    if (e->known == 0 || f->config.model != PLR_MODEL_BODY)
        return false;
    plr_evidence_note_pose(f, before);
    plr_motion_pose_covariance(&f->belief, &f->motion, e->P_before);
    return true;
}

void plr_evidence_after_map(plr_filter *f, const plr_evidence_pose *before) {
    plr_map_evidence *e = &f->evidence.map;
    e->adopted = f->evidence.events.adopted;
    memcpy(e->R_WB, f->belief.R_WB, sizeof e->R_WB);
    plr_pose_moved_from(&f->belief, before->R_WB, before->p_WB, e->moved);
    plr_motion_pose_covariance(&f->belief, &f->motion, e->P_after);
    plr_sensitivity_add_to_pose(&f->belief, &f->camera, &f->motion, e->calibration);
}

/* A bias that is well known, from a rest or from the caller, and moves, as where a gyro warms up, is no fault as
 * long as the settings allow a bias to be so large. */
static void add_biases(plr_filter *f, plr_bias_evidence *e) {
    plr_real P[PLR_POSE_SQUARE];
    e->estimated = plr_has_block(&f->belief, PLR_BLOCK_BIAS);
    if (!e->estimated)
        return;
    plr_covariance_get(&f->belief, PLR_BLOCK_BIAS, PLR_BLOCK_BIAS, P);
    for (unsigned k = 0; k < PLR_BIAS_DIM; k++) {
        e->off[k] = f->belief.bias[k] - f->source.bias_prior[k];
        const plr_real known = plr_bias_prior_variance(&f->source, k);
        const plr_real allowed = (plr_real)plr_filter_bias_variance(&f->config, k);
        e->prior[k] = known > allowed ? known : allowed;
        e->variance[k] = P[(PLR_BIAS_DIM + 1) * k];
    }
}

void plr_evidence_complete(plr_filter *f, plr_sightings *sightings) {
    plr_frame_evidence *e = &f->evidence;
    for (unsigned k = 0; k < sightings->count; k++)
        if (plr_gate_rejected(&sightings->at[k]))
            sightings->at[k].slot = plr_slots_find(&f->belief, sightings->at[k].seen->id);
    add_biases(f, &e->bias);
    e->events.miscalibrated = plr_calibration_is_off(&f->camera);
    e->has_gate = f->par.gate_d2 > 0 || f->par.gate_residual2 > 0;
    e->readings = plr_filter_readings_at(f, f->belief.t_ns);
}

/* ---------------------------------------------------------------- what is told of it */

static plr_rejection why(const plr_filter *f, unsigned slot) {
    const plr_sightings *frame = &f->work.sightings;
    if (f->belief.slots[slot].moving)
        return PLR_REJECTED_MOVES;
    for (unsigned k = 0; k < frame->count; k++)
        if (frame->at[k].slot == slot && frame->at[k].verdict == PLR_GATE_FAR)
            return PLR_REJECTED_FAR;
    return PLR_REJECTED_BY_GATE;
}

/* Puts a landmark among those of the largest mean2. */
static void insert(plr_supervision *told, plr_rejected_landmark landmark) {
    unsigned at = told->count < PLR_SUPERVISION_REJECTED ? told->count++ : PLR_SUPERVISION_REJECTED;
    for (; at > 0 && told->rejected[at - 1].mean2 < landmark.mean2; at--)
        if (at < PLR_SUPERVISION_REJECTED)
            told->rejected[at] = told->rejected[at - 1];
    if (at < PLR_SUPERVISION_REJECTED)
        told->rejected[at] = landmark;
}

plr_status plr_filter_supervision(const plr_filter *f, plr_supervision *told) {
    const plr_status sound = told ? plr_guard_check(f) : PLR_E_ARGUMENT;
    if (sound != PLR_OK)
        return sound;
    if (f->totals.frames == 0)
        return PLR_E_NOT_READY;
    plr_supervise_tell(&f->supervisor, &f->evidence, told);
    for (unsigned slot = 0; slot < f->belief.count; slot++) {
        const plr_slot *s = &f->belief.slots[slot];
        const plr_real variance = s->innovation_variance;
        if (s->last_frame != f->belief.frame_number || s->rejected == 0)
            continue;
        insert(told,
               (plr_rejected_landmark){
                   s->id, (uint8_t)why(f, slot), s->rejected,
                   variance > 0 ? (float)(plr_dot3(s->innovation_sum, s->innovation_sum) / variance)
                                : 0.0F});
    }
    return PLR_OK;
}

plr_status plr_filter_leave_out(plr_filter *f, uint64_t limits) {
    const plr_status sound = plr_guard_check_whole(f);
    if (sound != PLR_OK)
        return sound;
    plr_supervise_leave_out(&f->supervisor, limits);
    f->source.left_out = limits;
    plr_guard_seal_whole(f);
    return PLR_OK;
}
