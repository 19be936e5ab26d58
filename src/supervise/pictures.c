// SPDX-License-Identifier: MIT
#include "supervise/pictures.h"

#include <string.h>

#include "limits/limits.h"
#include "math/leaky.h"
#include "supervise/supervise.h"

/* ---------------------------------------------------------------- a frozen picture */

void plr_supervise_moved(plr_supervisor *s, const plr_picture_evidence *e) {
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        s->frozen_motion[k] += e->moved[k];
        s->frozen_variance[k] += e->variance[k];
    }
}

/* True if the motion since the picture was new is larger than its noise. */
static bool has_moved(const plr_supervisor *s, const plr_picture_evidence *e) {
    const plr_real above = plr_limit(s->left_out, PLR_LIMIT_FROZEN_ABOVE);
    plr_real sum = 0;
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        const plr_real moved = s->frozen_motion[k] + e->moved[k];
        const plr_real variance = s->frozen_variance[k] + e->variance[k];
        if (variance > 0)
            sum += moved * moved / variance;
        else if (moved * moved > PLR_R(1e-8))
            sum += PLR_R(2) * above;
    }
    return sum > above;
}

bool plr_pictures_show_present(plr_supervisor *s, const plr_picture_evidence *e) {
    const bool repeats =
        e->matched >= plr_limit_count(s->left_out, PLR_LIMIT_FEW) &&
        (plr_real)e->same >= plr_limit(s->left_out, PLR_LIMIT_FROZEN_SHARE) * (plr_real)e->matched;
    s->frozen = repeats && has_moved(s, e);
    if (!repeats) {
        memset(s->frozen_motion, 0, sizeof s->frozen_motion);
        memset(s->frozen_variance, 0, sizeof s->frozen_variance);
    } else if (!s->frozen) {
        plr_supervise_moved(s, e); /* this frame is used, and ends what is pending */
    }
    return !s->frozen;
}

/* One that was seen to repeat at once is but a frame that is missing: the odometry bridges it. */
bool plr_pictures_misled(const plr_supervisor *s) {
    bool used = false;
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        used = used || s->frozen_variance[k] > 0 || s->frozen_motion[k] * s->frozen_motion[k] > 0;
    return s->frozen && used;
}

/* ---------------------------------------------------------------- the gate */

bool plr_pictures_reject_all(const plr_supervisor *s, unsigned matched, unsigned gated) {
    return matched >= plr_limit_count(s->left_out, PLR_LIMIT_FEW) &&
           (plr_real)gated >= plr_limit(s->left_out, PLR_LIMIT_LOCK_SHARE) * (plr_real)matched;
}

bool plr_pictures_lock(plr_supervisor *s, unsigned matched, unsigned gated) {
    const uint16_t frames = (uint16_t)plr_limit_count(s->left_out, PLR_LIMIT_LOCK_FRAMES);
    const bool rejects = plr_pictures_reject_all(s, matched, gated);
    s->frames_mostly_gated = rejects ? (uint16_t)(s->frames_mostly_gated + 1) : 0;
    if (s->frames_mostly_gated >= 2 * frames) /* locked again */
        s->frames_mostly_gated = frames;
    return s->frames_mostly_gated == frames;
}

bool plr_pictures_open_fixed_gate(const plr_supervisor *s) {
    return s->frames_mostly_gated >= plr_limit_count(s->left_out, PLR_LIMIT_LOCK_FRAMES) ||
           s->frames_without_use >= plr_limit_count(s->left_out, PLR_LIMIT_LOST_FRAMES);
}

/* ---------------------------------------------------------------- counts */

static uint32_t noise_reasons(const plr_supervisor *s) {
    if (!(s->nis_dof > plr_limit(s->left_out, PLR_LIMIT_NIS_DOF)))
        return 0;
    return s->nis > plr_limit(s->left_out, PLR_LIMIT_NIS_HIGH) * s->nis_dof  ? PLR_REASON_NIS_HIGH
           : s->nis < plr_limit(s->left_out, PLR_LIMIT_NIS_LOW) * s->nis_dof ? PLR_REASON_NIS_LOW
                                                                             : 0;
}

uint32_t plr_pictures_add(plr_supervisor *s, const plr_report *report, plr_time_ns t_ns,
                          bool has_gate) {
    const uint32_t inert = plr_limit_count(s->left_out, PLR_LIMIT_INERT_MATCHES);
    const plr_real keeps = plr_limit(s->left_out, PLR_LIMIT_NIS_KEEPS);
    uint32_t reasons = 0;
    s->frames_without_use =
        report->used > 0 ? 0
                         : (uint16_t)(s->frames_without_use + (s->frames_without_use < UINT16_MAX));
    s->matches_since_gated = report->gated ? 0 : s->matches_since_gated + report->matched;
    if (s->matches_since_gated > inert)
        s->matches_since_gated = inert;
    s->nis = plr_leaky_sum(s->nis, keeps, (plr_real)report->nis);
    s->nis_dof = plr_leaky_sum(s->nis_dof, keeps, (plr_real)report->nis_dof);
    if (report->used < plr_limit_count(s->left_out, PLR_LIMIT_FEW))
        reasons |= PLR_REASON_FEW_OBSERVATIONS;
    const bool late =
        s->last_use_ns != PLR_NEVER_NS && t_ns > s->last_use_ns &&
        (plr_real)(t_ns - s->last_use_ns) * PLR_R(1e-9) > plr_limit(s->left_out, PLR_LIMIT_LOST_S);
    if (s->frames_without_use >= plr_limit_count(s->left_out, PLR_LIMIT_LOST_FRAMES) ||
        (s->frames_without_use > 0 && late))
        reasons |= PLR_REASON_NO_OBSERVATIONS;
    if (s->matches_since_gated >= inert && has_gate)
        reasons |= PLR_REASON_GATE_INERT;
    if (s->frozen)
        reasons |= PLR_REASON_FROZEN_IMAGE;
    return reasons | noise_reasons(s);
}
