// SPDX-License-Identifier: MIT
/* TWIST, STEREO, TRUTH, READING: what a robot and its reference measure. */
#include "record/layout.h"

void plr_layout_twist(plr_pass *p, plr_twist_message *m) {
    plr_pass_u64(p, &m->t_ns);
    plr_pass_f64s(p, m->twist.v_B_mps, 3);
    plr_pass_f64s(p, m->twist.w_B_radps, 3);
}

static void pass_observation(plr_pass *p, plr_observation *o) {
    plr_pass_u32(p, &o->id);
    plr_pass_f32(p, &o->uL_px);
    plr_pass_f32(p, &o->vL_px);
    plr_pass_f32(p, &o->uR_px);
    plr_pass_f32(p, &o->vR_px);
}

/* What is read goes to the reader's array; what is written comes from the message's, which is only
 * looked at. */
static plr_observation *observations_of(plr_pass *p, plr_frame *m) {
    if (!plr_pass_reads(p)) {
        plr_pass_require(p, m->count == 0 || m->observations);
        return (plr_observation *)m->observations;
    }
    if (m->count > p->max_observations)
        plr_pass_fail(p, PLR_FAULT_TOO_LONG);
    m->observations = p->observations;
    return p->observations;
}

void plr_layout_stereo(plr_pass *p, plr_frame *m) {
    plr_pass_u64(p, &m->t_ns);
    plr_pass_u16(p, &m->budget);
    plr_pass_u16(p, &m->count);
    plr_pass_require(p, m->count <= PLR_WIRE_MAX_OBSERVATIONS);
    plr_observation *observations = observations_of(p, m);
    for (unsigned i = 0; i < m->count && p->fault == PLR_FAULT_NONE; i++)
        pass_observation(p, &observations[i]);
}

void plr_layout_truth(plr_pass *p, plr_truth *m) {
    plr_pass_u64(p, &m->t_ns);
    plr_pass_f64s(p, m->T_WB.R, 9);
    plr_pass_f64s(p, m->T_WB.p, 3);
}

/* Which sensors and axes there are is for the filter to say. */
void plr_layout_reading(plr_pass *p, plr_reading *m) {
    plr_pass_u64(p, &m->t_ns);
    plr_pass_u8(p, &m->sensor);
    plr_pass_u8(p, &m->axes);
    plr_pass_f64s(p, m->value, 3);
    plr_pass_reals(p, m->sigma, 3, 4);
    plr_pass_reals(p, m->at_B_m, 3, 4);
}
