// SPDX-License-Identifier: MIT
#include "eyes/expect.h"

#include "math/small.h"
#include "math/so3.h"

/* s; a velocity tells nothing beyond. */
#define HOLDS_S PLR_R(0.5)

/* (R, p) <- (R, p) (Exp(w dt), v dt) */
static void advance(plr_eyes_motion *m, plr_time_ns t_ns, const plr_real v[3],
                    const plr_real w[3]) {
    if (t_ns <= m->t_ns)
        return;
    const plr_real elapsed = (plr_real)((double)(t_ns - m->t_ns) * 1e-9);
    const plr_real dt = elapsed < HOLDS_S ? elapsed : HOLDS_S;
    const plr_real theta[3] = {w[0] * dt, w[1] * dt, w[2] * dt};
    const plr_real step[3] = {v[0] * dt, v[1] * dt, v[2] * dt};
    plr_real dR[9], R[9], dp[3];
    plr_so3_exp(dR, theta);
    plr_mat3_vec(dp, m->R, step);
    plr_mat3_mul(R, m->R, dR);
    memcpy(m->R, R, sizeof R);
    for (int i = 0; i < 3; i++)
        m->p[i] += dp[i];
    m->t_ns = t_ns;
}

static void begin(plr_eyes_motion *m, plr_time_ns t_ns) {
    plr_mat3_identity(m->R);
    memset(m->p, 0, sizeof m->p);
    m->t_ns = t_ns;
}

void plr_eyes_motion_step(plr_eyes_motion *m, plr_time_ns t_ns, const plr_twist *velocity) {
    plr_real v[3], w[3], mean_v[3], mean_w[3];
    for (int i = 0; i < 3; i++) {
        v[i] = (plr_real)velocity->v_B_mps[i];
        w[i] = (plr_real)velocity->w_B_radps[i];
        mean_v[i] = (m->v[i] + v[i]) / 2;
        mean_w[i] = (m->w[i] + w[i]) / 2;
    }
    if (m->known)
        advance(m, t_ns, mean_v, mean_w);
    else
        begin(m, t_ns);
    m->known = true;
    memcpy(m->v, v, sizeof v);
    memcpy(m->w, w, sizeof w);
}

/* Exactly orthonormal to rounding: float32 leaves 1e-6 after many steps. */
static void to_pose(plr_pose *to, plr_real R[9], const plr_real p[3]) {
    plr_so3_orthonormalise(R);
    for (int i = 0; i < 9; i++)
        to->R[i] = (double)R[i];
    for (int i = 0; i < 3; i++)
        to->p[i] = (double)p[i];
}

/* The camera stands at -C^T t on the body: w_C = C w, v_C = C v - w_C x t. */
static void tell_velocity(const plr_eyes_motion *m, const plr_real C[9], const plr_real t[3],
                          bool place_known, plr_expected *e) {
    plr_real v[3], w[3], lever[3];
    plr_mat3_vec(v, C, m->v);
    plr_mat3_vec(w, C, m->w);
    plr_cross3(lever, w, t);
    for (int i = 0; i < 3; i++) {
        e->w_C_radps[i] = (double)w[i];
        e->v_C_mps[i] = place_known ? (double)(v[i] - lever[i]) : 0.0;
    }
    e->velocity_known = true;
}

bool plr_eyes_motion_take(plr_eyes_motion *m, plr_time_ns t_ns, const plr_pose *T_CB,
                          bool place_known, plr_expected *expected) {
    if (!m->known)
        return false;
    advance(m, t_ns, m->v, m->w);
    /* x_C = R_CB R^T (R_CB^T (x - t) - p) + t = E x + (t - E t - R_CB R^T p) */
    plr_real C[9], t[3], CR[9], E[9], Et[3], moved[3], p[3] = {0, 0, 0};
    for (int i = 0; i < 9; i++)
        C[i] = (plr_real)T_CB->R[i];
    for (int i = 0; i < 3; i++)
        t[i] = (plr_real)T_CB->p[i];
    plr_mat3_mul_nt(CR, C, m->R);
    plr_mat3_mul_nt(E, CR, C);
    plr_mat3_vec(Et, E, t);
    plr_mat3_vec(moved, CR, m->p);
    for (int i = 0; i < 3 && place_known; i++)
        p[i] = t[i] - Et[i] - moved[i];
    to_pose(&expected->motion, E, p);
    tell_velocity(m, C, t, place_known, expected);
    begin(m, t_ns);
    return true;
}
