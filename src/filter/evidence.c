// SPDX-License-Identifier: MIT
#include "filter/evidence.h"

#include <string.h>

#include "filter/filter_internal.h"
#include "process/process.h"
#include "state/blocks.h"
#include "state/covariance.h"
#include "state/pose.h"
#include "state/sensitivity.h"
#include "state/slots.h"

void plr_evidence_begin(plr_filter *f) {
    memset(&f->work.evidence, 0, sizeof f->work.evidence);
}

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

void plr_evidence_of_picture(plr_filter *f, const plr_frame *frame, unsigned n) {
    plr_picture_evidence *e = &f->work.evidence.picture;
    for (unsigned k = 0; k < n; k++) {
        if (f->work.slot_of[k] == PLR_NO_SLOT)
            continue;
        plr_slot *slot = &f->slots[f->work.slot_of[k]];
        const uint32_t hash = hash_of_pixels(&frame->observations[f->work.order[k]]);
        e->matched++;
        e->same += slot->pixel_hash == hash;
        slot->pixel_hash = hash;
    }
    plr_filter_pending_motion(f, e);
}

void plr_evidence_note_pose(const plr_filter *f, plr_evidence_pose *pose) {
    memcpy(pose->R_WB, f->R_WB, sizeof pose->R_WB);
    memcpy(pose->p_WB, f->p_WB, sizeof pose->p_WB);
}

void plr_evidence_of_motion(plr_filter *f, const plr_evidence_pose *by_odometry,
                            const plr_applied_motion *stated, const plr_motion_first *first,
                            const plr_correction *correction) {
    plr_motion_evidence *e = &f->work.evidence.motion;
    e->applied = true;
    e->outright = first->outright;
    memcpy(e->E, first->motion.E, sizeof e->E);
    memcpy(e->p, first->motion.p, sizeof e->p);
    memcpy(e->L, stated->L, sizeof e->L);
    memcpy(e->L_used, first->motion.L, sizeof e->L_used);
    memcpy(e->nu, correction->nu, sizeof e->nu);
    memcpy(e->Lambda, correction->Lambda, sizeof e->Lambda);
    plr_pose_moved_from(f, by_odometry->R_WB, by_odometry->p_WB, e->moved);
}

bool plr_evidence_before_map(plr_filter *f, unsigned n, plr_evidence_pose *before) {
    plr_map_evidence *e = &f->work.evidence.map;
    for (unsigned k = 0; k < n; k++)
        e->known += f->work.slot_of[k] != PLR_NO_SLOT && f->slots[f->work.slot_of[k]].known;
    if (e->known == 0 || f->config.model != PLR_MODEL_BODY)
        return false;
    plr_evidence_note_pose(f, before);
    plr_motion_pose_covariance(f, e->P_before);
    return true;
}

void plr_evidence_after_map(plr_filter *f, const plr_evidence_pose *before) {
    plr_map_evidence *e = &f->work.evidence.map;
    e->adopted = f->work.evidence.events.adopted;
    memcpy(e->R_WB, f->R_WB, sizeof e->R_WB);
    plr_pose_moved_from(f, before->R_WB, before->p_WB, e->moved);
    plr_motion_pose_covariance(f, e->P_after);
    plr_sensitivity_add_to_pose(f, e->calibration);
}

static void add_biases(plr_filter *f, plr_bias_evidence *e) {
    plr_real P[PLR_POSE_SQUARE];
    e->estimated = plr_has_block(f, PLR_BLOCK_BIAS);
    if (!e->estimated)
        return;
    plr_covariance_get(f, PLR_BLOCK_BIAS, PLR_BLOCK_BIAS, P);
    for (unsigned k = 0; k < PLR_BIAS_DIM; k++) {
        e->off[k] = f->bias[k] - f->bias_prior[k];
        e->prior[k] = plr_bias_prior_variance(f, k);
        e->variance[k] = P[(PLR_BIAS_DIM + 1) * k];
    }
}

void plr_evidence_complete(plr_filter *f) {
    plr_frame_evidence *e = &f->work.evidence;
    add_biases(f, &e->bias);
    e->has_gate = f->par.gate_d2 > 0 || f->par.gate_residual2 > 0;
    e->readings = plr_filter_readings_at(f, f->t_ns);
}
