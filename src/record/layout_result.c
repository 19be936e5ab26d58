// SPDX-License-Identifier: MIT
/* LANDMARK, POSE, REPORT: what a filter gives. */
#include "record/layout.h"

/* A symmetric 3x3 matrix by its lower triangle, row by row. */
static void pass_symmetric3(plr_pass *p, double *A) {
    for (unsigned row = 0; row < 3; row++)
        plr_pass_f64s(p, &A[3 * row], row + 1);
    if (plr_pass_reads(p)) {
        A[1] = A[3];
        A[2] = A[6];
        A[5] = A[7];
    }
}

void plr_layout_landmark(plr_pass *p, plr_landmark_message *m) {
    plr_pass_u64(p, &m->landmark.last_seen_ns);
    plr_pass_choice(p, &m->role, PLR_LANDMARK_FINAL);
    plr_pass_reserved(p);
    plr_pass_u32(p, &m->landmark.id);
    plr_pass_u32(p, &m->landmark.times_seen);
    plr_pass_f64s(p, m->landmark.p_W_m, 3);
    pass_symmetric3(p, m->landmark.P_W_m2);
    if (plr_pass_reads(p)) {
        m->landmark.times_gated = 0;
        m->landmark.known = m->role == PLR_LANDMARK_KNOWN;
    }
}

/* At the end, since version 1.3; a payload of 1.2 ends before. */
static void pass_trace(plr_pass *p, plr_pose_message *m) {
    if (plr_pass_reads(p) && p->left == 0) {
        m->trace = -1;
        for (unsigned i = 0; i < 6; i++)
            m->bias_variance[i] = -1;
        return;
    }
    plr_pass_f64s(p, &m->trace, 1);
    plr_pass_reals(p, m->bias_variance, 6, 4);
}

void plr_layout_pose(plr_pass *p, plr_pose_message *m) {
    plr_pass_u64(p, &m->t_ns);
    plr_pass_u8(p, &m->real_bytes);
    plr_pass_require(p, m->real_bytes == 4 || m->real_bytes == 8);
    plr_pass_flags(p, &m->after_update, NULL);
    plr_pass_u16(p, &m->reset_count);
    plr_pass_f64s(p, m->T_WB.p, 3);
    plr_pass_reals(p, m->T_WB.R, 9, m->real_bytes);
    plr_pass_reals(p, m->P_xi, 21, m->real_bytes);
    plr_pass_reals(p, m->velocity.v_B_mps, 3, m->real_bytes);
    plr_pass_reals(p, m->velocity.w_B_radps, 3, m->real_bytes);
    plr_pass_reals(p, m->bias, 6, m->real_bytes);
    plr_pass_reals(p, m->P_u, 21, m->real_bytes);
    pass_trace(p, m);
}

/* As i8. Numbers below those of types.h are let through: a later version's reason for a refusal. */
static void pass_status(plr_pass *p, plr_status *status) {
    int number = plr_pass_reads(p) ? 0 : (int)*status;
    uint8_t bits = (uint8_t)(number & 0xFF);
    plr_pass_u8(p, &bits);
    if (plr_pass_reads(p))
        number = bits <= INT8_MAX ? bits : bits - 256;
    plr_pass_require(p, number <= PLR_OK && number >= INT8_MIN);
    if (plr_pass_reads(p))
        *status = (plr_status)number;
}

static void pass_health(plr_pass *p, plr_health *health) {
    uint8_t bits = plr_pass_reads(p) ? 0 : (uint8_t)(*health & 0xFF);
    plr_pass_u8(p, &bits);
    if (plr_pass_reads(p))
        *health = (plr_health)bits;
    plr_pass_require(p, (unsigned)*health <= PLR_HEALTH_DIVERGED);
}

/* Reasons stand in two places: the upper half came with version 1.2, at the end, where a reader of 1.1
 * passes over it. A payload of 1.1 ends before it. */
static void pass_upper_reasons(plr_pass *p, plr_report *r, uint16_t lower) {
    uint16_t upper = plr_pass_reads(p) ? 0 : (uint16_t)(r->reasons >> 16);
    if (!plr_pass_reads(p) || p->left > 0)
        plr_pass_u16(p, &upper);
    if (plr_pass_reads(p))
        r->reasons = (uint32_t)upper << 16 | lower;
}

void plr_layout_report(plr_pass *p, plr_report_message *m) {
    plr_report *r = &m->report;
    uint16_t lower_reasons = plr_pass_reads(p) ? 0 : (uint16_t)(r->reasons & 0xFFFFU);
    plr_pass_u64(p, &r->t_ns);
    plr_pass_u8(p, &m->subject);
    pass_status(p, &r->status);
    pass_health(p, &r->health);
    plr_pass_reserved(p);
    plr_pass_u16(p, &lower_reasons);
    plr_pass_u16(p, &r->budget);
    plr_pass_u16(p, &r->observations);
    plr_pass_u16(p, &r->matched);
    plr_pass_u16(p, &r->used);
    plr_pass_u16(p, &r->gated);
    plr_pass_u16(p, &r->created);
    plr_pass_u16(p, &r->evicted);
    plr_pass_u16(p, &r->refused);
    plr_pass_u16(p, &r->duplicates);
    plr_pass_u16(p, &r->no_room);
    plr_pass_u16(p, &r->poor);
    plr_pass_u16(p, &r->left_out);
    plr_pass_u16(p, &r->blocks_failed);
    plr_pass_u16(p, &r->active);
    plr_pass_u16(p, &r->nis_dof);
    plr_pass_f32(p, &r->nis);
    plr_pass_u32(p, &m->update_us);
    pass_upper_reasons(p, r, lower_reasons);
    if (plr_pass_reads(p) && p->left == 0) {
        m->notice = PLR_NOTICE_NONE; /* before version 1.3 */
        return;
    }
    plr_pass_u8(p, &m->notice);
    plr_pass_reserved(p);
}
