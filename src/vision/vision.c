// SPDX-License-Identifier: MIT
#include "pelorus/vision.h"

#include <string.h>

#include "math/small.h"
#include "vision/corners.h"
#include "vision/rig.h"
#include "vision/track.h"
#include "vision/watch.h"

enum {
    READY = 0x45594553,  /* "EYES" */
    DISPARITY_SHARE = 6, /* of the width */
    MORE_TRIES = 8,      /* of births, beside twice as many as are wanted */
    MIRROR_TRIES = 20,   /* births before which swapped sides are asked for */
    SWAPPED_AFTER = 10   /* finds on the wrong side */
};

#define CROWDED_PX PLR_R(3)
/* Of a row gap beside the pair's median: twice what real pictures show, 0.2 to 0.3 px. */
#define STRAY_PX PLR_R(0.5)

/* --- life --- */

plr_status plr_vision_init_sized(plr_vision *v, const plr_rig *rig,
                                 const plr_vision_sizes *caller) {
    const plr_vision_sizes own = plr_vision_sizes_here((uint32_t)sizeof(plr_vision));
    if (!v || !rig || !caller)
        return PLR_E_ARGUMENT;
    if (memcmp(&own, caller, sizeof own) != 0)
        return PLR_E_SIZE;
    memset(v, 0, sizeof *v);
    plr_status status = plr_check_rig(rig);
    if (status != PLR_OK)
        return status;
    v->width = rig->left.width_px, v->height = rig->left.height_px;
    v->levels = (uint8_t)plr_pyramid_levels(v->width, v->height);
    v->wanted = rig->tracks ? rig->tracks : PLR_VISION_TRACKS;
    v->disparity_max =
        rig->disparity_max_px ? rig->disparity_max_px : (uint16_t)(v->width / DISPARITY_SHARE);
    v->row_time = (plr_real)rig->row_time_s;
    status = plr_rig_prepare(v, rig);
    v->ready = status == PLR_OK ? READY : 0;
    return status;
}

plr_status plr_vision_calibration(const plr_vision *v, const plr_pose *T_LB,
                                  plr_calibration *calibration) {
    if (!v || !T_LB || !calibration)
        return PLR_E_ARGUMENT;
    if (v->ready != READY)
        return PLR_E_NOT_READY;
    calibration->fx_px = (double)v->fx, calibration->fy_px = (double)v->fy;
    calibration->cx_px = (double)v->cx, calibration->cy_px = (double)v->cy;
    calibration->baseline_m = (double)v->baseline;
    for (int i = 0; i < 3; i++) {
        double p = 0;
        for (int j = 0; j < 3; j++) {
            double R = 0;
            for (int k = 0; k < 3; k++)
                R += (double)v->R_CS[PLR_LEFT][3 * i + k] * T_LB->R[3 * k + j];
            calibration->T_CB.R[3 * i + j] = R;
            p += (double)v->R_CS[PLR_LEFT][3 * i + j] * T_LB->p[j];
        }
        calibration->T_CB.p[i] = p;
    }
    return PLR_OK;
}

plr_status plr_vision_forget(plr_vision *v) {
    if (!v)
        return PLR_E_ARGUMENT;
    if (v->ready != READY)
        return PLR_E_NOT_READY;
    v->has_pair = false;
    v->track_count = 0;
    memset(&v->gaps, 0, sizeof v->gaps);
    return PLR_OK;
}

/* --- what is expected --- */

/* The motion since the last pair, and how points move within this one: as the velocity says, else as since
 * the last pair, on average. */
static void take_motion(const plr_vision *v, const plr_expected *e, const plr_picture_pair *pair,
                        plr_expected_motion *m) {
    memset(m, 0, sizeof *m);
    plr_mat3_identity(m->R);
    const plr_time_ns left = pair->left.t_ns, right = pair->right.t_ns;
    m->right_late = (plr_real)((double)(int64_t)(right - left) * 1e-9);
    m->known = e && (v->has_pair || e->velocity_known);
    if (!m->known)
        return;
    if (v->has_pair)
        for (int i = 0; i < 9; i++)
            m->R[i] = (plr_real)e->motion.R[i], m->p[i / 3] = (plr_real)e->motion.p[i / 3];
    m->place_known = plr_dot3(m->p, m->p) > 0;
    if (e->velocity_known) {
        for (int i = 0; i < 3; i++)
            m->w[i] = -(plr_real)e->w_C_radps[i], m->u[i] = -(plr_real)e->v_C_mps[i];
        return;
    }
    const plr_real rate = (plr_real)(1e9 / (double)(left - v->t_ns));
    plr_turn_of(m->w, m->R);
    for (int i = 0; i < 3; i++)
        m->w[i] *= rate, m->u[i] = m->p[i] * rate;
}

/* The depth that the caller knows, as a disparity. */
static void take_depth(const plr_vision *v, const plr_expected *e, plr_track *t) {
    for (unsigned i = 0; e && i < e->depth_count; i++)
        if (e->depths[i].id == t->id && e->depths[i].z_m > 0 && e->depths[i].z_m < 1e9F)
            t->surface.disparity = v->fx * v->baseline / (plr_real)e->depths[i].z_m;
}

/* --- the tracks of a pair --- */

/* Removes those that have ended; the others keep their order. */
static void drop_ended(plr_vision *v) {
    unsigned kept = 0;
    for (unsigned i = 0; i < v->track_count; i++) {
        const plr_track *t = &v->tracks[i];
        if (!t->why) {
            if (kept != i)
                v->tracks[kept] = *t;
            kept++;
        } else if (t->age > 0) {
            const plr_ended_track ended = {t->id, t->age, t->why};
            v->ended[v->report.ended++] = ended;
        }
    }
    v->track_count = (uint16_t)kept;
}

static bool near(const plr_track *t, const plr_real at[2], plr_real px) {
    const plr_real x = t->at[0] - at[0], y = t->at[1] - at[1];
    return PLR_FMA(x, x, y * y) < px * px;
}

/* Of two tracks that have come together the younger one ends. */
static void part(plr_vision *v) {
    for (unsigned i = 0; i < v->track_count; i++)
        for (unsigned j = i + 1; j < v->track_count && !v->tracks[i].why; j++)
            if (!v->tracks[j].why && near(&v->tracks[j], v->tracks[i].at, CROWDED_PX))
                v->tracks[j].why = PLR_TRACK_CROWDED;
}

static void miss(plr_track *t, plr_track_end why) {
    t->seen = false;
    if (++t->misses > PLR_VISION_MISSES)
        t->why = (uint8_t)why;
}

/* Pictures in which nothing can be followed: tracks go where they are expected. */
static void wait(plr_vision *v, const plr_scene *s, bool both_repeat) {
    for (unsigned i = 0; i < v->track_count; i++) {
        plr_track *t = &v->tracks[i];
        t->age++;
        if (plr_track_expect(v, &s->motion, t) && !both_repeat)
            miss(t, PLR_TRACK_UNSEEN);
    }
    drop_ended(v);
}

static void follow(plr_vision *v, const plr_scene *s, const plr_expected *e) {
    for (unsigned i = 0; i < v->track_count; i++) {
        plr_track *t = &v->tracks[i];
        t->age++;
        t->seen = false;
        take_depth(v, e, t);
        if (plr_track_expect(v, &s->motion, t))
            (void)plr_track_follow(v, s, t);
    }
    part(v);
    drop_ended(v);
    v->report.followed = v->track_count;
}

static void match(plr_vision *v, const plr_scene *s) {
    for (unsigned i = 0; i < v->track_count; i++)
        v->tracks[i].seen = plr_track_match(v, s, &v->tracks[i], false);
}

/* Whether a track is so near that a birth would follow the same. */
static bool is_taken(const plr_vision *v, const plr_real at[2], plr_real px) {
    for (unsigned i = 0; i < v->track_count; i++)
        if (near(&v->tracks[i], at, px))
            return true;
    return false;
}

static bool begin(plr_vision *v, const plr_scene *s, const plr_real at[2], plr_real apart) {
    plr_track *t = &v->tracks[v->track_count];
    if (!plr_track_begin(v, s, t, at) || is_taken(v, t->at, apart))
        return false;
    v->report.corners++;
    if (!plr_track_match(v, s, t, true)) {
        if (v->proper < MIRROR_TRIES)
            v->mirrored += plr_track_mirrored(v, s, t);
        return false;
    }
    v->proper += v->proper < MIRROR_TRIES;
    if (!plr_track_stays(v, &s->motion, t))
        return false;
    t->seen = true;
    return true;
}

static void fill(plr_vision *v, const plr_scene *s) {
    plr_corner corners[PLR_CORNERS];
    if (v->track_count >= v->wanted)
        return;
    const unsigned n = plr_corners_find(v, &s->side[PLR_LEFT], corners);
    const plr_real apart = (plr_real)plr_cells_of(v->width, v->height).side_px / 2;
    unsigned tries = 2U * (unsigned)(v->wanted - v->track_count) + MORE_TRIES;
    for (unsigned i = 0; i < n && v->track_count < v->wanted && tries > 0; i++) {
        const plr_real at[2] = {(plr_real)corners[i].u, (plr_real)corners[i].v};
        if (is_taken(v, at, apart))
            continue;
        tries--;
        if (begin(v, s, at, apart))
            v->track_count++, v->next_id++;
    }
}

/* The median of the row gaps of what is seen. */
static plr_real usual_row_gap(const plr_vision *v) {
    plr_real sorted[PLR_VISION_TRACKS];
    unsigned n = 0;
    for (unsigned i = 0; i < v->track_count; i++) {
        unsigned j = n;
        if (!v->tracks[i].seen)
            continue;
        for (n++; j > 0 && sorted[j - 1] > v->tracks[i].row_gap; j--)
            sorted[j] = sorted[j - 1];
        sorted[j] = v->tracks[i].row_gap;
    }
    return n > 0 ? sorted[n / 2] : PLR_R(0);
}

/* Whose rows differ otherwise than those of the pair's others has been matched wrong, along the line as
 * well as across it: it is not seen, and a birth is none. The others tell what calibration and timing do to
 * all. */
static void judge_rows(plr_vision *v) {
    const plr_real usual = usual_row_gap(v);
    for (unsigned i = 0; i < v->track_count; i++) {
        plr_track *t = &v->tracks[i];
        if (t->seen && plr_abs(t->row_gap - usual) < STRAY_PX) {
            t->misses = 0;
            (*(t->age > 0 ? &v->report.observed : &v->report.born))++;
        } else if (t->age > 0) {
            miss(t, PLR_TRACK_NO_RIGHT);
        } else {
            t->why = PLR_TRACK_NO_RIGHT;
        }
    }
    drop_ended(v);
}

/* --- what is handed out --- */

/* In the virtual camera's px. */
static plr_real sigma_of(const plr_vision *v, const plr_track *t) {
    const plr_real scale = v->fx / v->optics[PLR_LEFT].fx;
    const plr_real var = (t->cov[0] + t->cov[2] + t->cov[0] + t->var_right) / 3 + t->var_cut;
    return scale * PLR_SQRT(var);
}

static void hand_out(plr_vision *v, const plr_scene *s, plr_frame *frame) {
    unsigned n = 0;
    for (unsigned i = 0; i < v->track_count; i++) {
        const plr_track *t = &v->tracks[i];
        const plr_real depth = plr_rig_depth(v, t->surface.disparity);
        plr_real L[3], R[3], left[2], right[2];
        if (!t->seen || !plr_rig_point(v, &s->motion, PLR_LEFT, t->at, depth, L) ||
            !plr_rig_point(v, &s->motion, PLR_RIGHT, t->right, depth, R))
            continue;
        plr_rig_virtual(v, PLR_LEFT, L, left);
        plr_rig_virtual(v, PLR_RIGHT, R, right);
        const plr_observation o = {t->id,           (float)left[0],  (float)left[1],
                                   (float)right[0], (float)right[1], 0};
        const plr_sight sight = {t->id, t->age, (float)sigma_of(v, t), (float)t->likeness};
        v->observations[n] = o;
        v->sights[n++] = sight;
    }
    plr_watch_rows(v, &s->motion, n);
    frame->count = (uint16_t)n;
}

/* The two pictures, or one of them, cannot be used: true. */
static bool cannot_see(plr_vision *v, const plr_scene *s, plr_frame *frame) {
    const plr_vision_report *r = &v->report;
    const bool left = r->left & PLR_PICTURE_REPEATED, right = r->right & PLR_PICTURE_REPEATED;
    if (left && right) {
        wait(v, s, true);
        return true;
    }
    if (left || right || (r->left & PLR_PICTURE_UNUSABLE)) {
        wait(v, s, false);
        frame->count = 0;
        return true;
    }
    return false;
}

static void look(plr_vision *v, const plr_scene *s, const plr_expected *e, plr_frame *frame) {
    follow(v, s, e);
    match(v, s);
    if (!(v->report.right & PLR_PICTURE_UNUSABLE))
        fill(v, s);
    judge_rows(v);
    v->report.swapped = v->mirrored >= SWAPPED_AFTER && v->mirrored > 3 * v->proper;
    hand_out(v, s, frame);
}

plr_status plr_vision_track(plr_vision *v, const plr_picture_pair *pair,
                            const plr_expected *expected, plr_frame *frame) {
    if (!v || !pair || !frame)
        return PLR_E_ARGUMENT;
    if (v->ready != READY)
        return PLR_E_NOT_READY;
    plr_status status = plr_check_pair(v, pair);
    if (status == PLR_OK)
        status = plr_check_expected(expected);
    if (status != PLR_OK)
        return status;
    plr_scene s;
    memset(&v->report, 0, sizeof v->report);
    take_motion(v, expected, pair, &s.motion);
    plr_pyramid_build(&s.side[PLR_LEFT], &pair->left, v->levels, v->pyramid[PLR_LEFT]);
    plr_pyramid_build(&s.side[PLR_RIGHT], &pair->right, v->levels, v->pyramid[PLR_RIGHT]);
    const bool first = !v->has_pair;
    v->report.left = plr_watch_picture(&s.side[PLR_LEFT], &v->hash[PLR_LEFT], first);
    v->report.right = plr_watch_picture(&s.side[PLR_RIGHT], &v->hash[PLR_RIGHT], first);
    const double half_s = (double)v->row_time * (v->height - 1) / 2;
    frame->t_ns = pair->left.t_ns + (plr_time_ns)(half_s * 1e9);
    frame->budget = PLR_NO_BUDGET;
    frame->observations = v->observations;
    frame->count = v->shown;
    if (!cannot_see(v, &s, frame))
        look(v, &s, expected, frame);
    v->shown = frame->count;
    v->report.t_ns = frame->t_ns;
    v->t_ns = pair->left.t_ns;
    v->has_pair = true;
    return PLR_OK;
}
