// SPDX-License-Identifier: MIT
#include "state/pose.h"

#include "math/se3.h"
#include "math/small.h"
#include "math/so3.h"
#include "state/rigid_fit.h"

/* Without the orthonormalisation, an hour of steps in float32 makes R deviate from a rotation by
 * 0.01. */
void plr_pose_move(plr_filter *f, const plr_real E[9], const plr_real d[3]) {
    plr_real step[3], change[9];
    plr_mat3_vec(step, f->R_WB, d);
    plr_mat3_mul(change, f->R_WB, E);
    for (int i = 0; i < 3; i++)
        f->p_WB[i] += (double)step[i];
    for (int i = 0; i < 9; i++)
        f->R_WB[i] += change[i];
    plr_so3_orthonormalise(f->R_WB);
}

bool plr_pose_is_correction(const plr_real xi[PLR_POSE_DIM]) {
    static const plr_real max_way2 = 1e6;
    return plr_dot3(xi, xi) < max_way2 && plr_dot3(xi + 3, xi + 3) < PLR_MAX_CORRECTION_TURN2;
}

void plr_pose_correct(plr_filter *f, const plr_real xi[PLR_POSE_DIM]) {
    plr_real E[9], p[3];
    plr_se3_expm1(E, p, xi);
    plr_pose_move(f, E, p);
}

/* The twist from one pose to another, in the body of the first, to first order. */
static void between(const plr_real R_from[9], const double p_from[3], const plr_real R_to[9],
                    const double p_to[3], plr_real xi[PLR_POSE_DIM]) {
    plr_real way[3], R[9];
    for (int i = 0; i < 3; i++)
        way[i] = (plr_real)(p_to[i] - p_from[i]);
    plr_mat3_tvec(xi, R_from, way);
    plr_mat3_mul_tn(R, R_from, R_to);
    plr_turn_of(xi + 3, R);
}

void plr_pose_moved_from(const plr_filter *f, const plr_real R_WB[9], const double p_WB[3],
                         plr_real moved[PLR_POSE_DIM]) {
    between(R_WB, p_WB, f->R_WB, f->p_WB, moved);
}

/* theta <- the rotation vector of R, of which it is the vector of sines: the angle from tan(t / 2) =
 * sin t / (1 + cos t), roughly, and then by Newton's steps, which stay on the axis. */
static void sines_to_rotation_vector(const plr_real R[9], plr_real theta[3]) {
    const plr_real sine = PLR_SQRT(plr_dot3(theta, theta));
    const plr_real cosine = PLR_R(0.5) * (R[0] + R[4] + R[8] - PLR_R(1));
    const plr_real tangent = sine / (PLR_R(1) + cosine + PLR_R(1e-3));
    const plr_real small = tangent < 1 ? tangent : PLR_R(1) / tangent;
    const plr_real arc = small * (PLR_R(0.7854) + PLR_R(0.273) * (PLR_R(1) - small));
    const plr_real angle = PLR_R(2) * (tangent < 1 ? arc : PLR_R(1.5708) - arc);
    if (!(sine > PLR_R(1e-6)))
        return; /* small, or half a turn about an axis that the sines do not tell */
    for (unsigned i = 0; i < 3; i++)
        theta[i] *= angle / sine;
    for (unsigned step = 0; step < 3; step++) {
        plr_real back[9], left[9], rest[3];
        plr_so3_exp(back, theta);
        plr_mat3_mul_tn(left, back, R);
        plr_turn_of(rest, left);
        for (unsigned i = 0; i < 3; i++)
            theta[i] += rest[i];
    }
}

void plr_pose_towards(const plr_filter *f, const plr_real R_WB[9], const double p_WB[3],
                      plr_real xi[PLR_POSE_DIM]) {
    plr_real R[9];
    between(f->R_WB, f->p_WB, R_WB, p_WB, xi);
    plr_mat3_mul_tn(R, f->R_WB, R_WB);
    sines_to_rotation_vector(R, xi + 3);
}

void plr_pose_reference(const plr_filter *f, plr_real R_WB[9], double p_WB[3]) {
    plr_real moved[3];
    memcpy(R_WB, f->R_WB, sizeof f->R_WB);
    memcpy(p_WB, f->p_WB, sizeof f->p_WB);
    if (!f->motion.pending)
        return;
    plr_real back[9];
    plr_mat3_mul_nt(back, f->R_WB, f->motion.E); /* T D^-1 */
    for (int i = 0; i < 9; i++)
        R_WB[i] += back[i];
    plr_so3_orthonormalise(R_WB);
    plr_mat3_vec(moved, R_WB, f->motion.p);
    for (int i = 0; i < 3; i++)
        p_WB[i] -= (double)moved[i];
}

void plr_filter_diverge(plr_filter *f) {
    if (!f->diverged)
        f->totals.diverged_ns = f->t_ns;
    f->diverged = 1;
    f->work.noise.open = 0; /* W is not added to P any more */
}
