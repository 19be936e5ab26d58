// SPDX-License-Identifier: MIT
#include "filter/map_check.h"

#include <string.h>

#include "filter/consistency.h"
#include "filter/windows.h"
#include "math/dense.h"
#include "math/small.h"
#include "state/motion.h"
#include "state/pose.h"
#include "state/sensitivity.h"
#include "state/slots.h"

enum {
    FRAMES = 15, /* of attention: what the pixels' noise hides in the first, the next ones show */
    LEAST = 4    /* landmarks */
};

/* Chi-square with 6 degrees of freedom: chance exceeds it once in 360,000. */
#define DISAGREES_ABOVE PLR_R(36)
/* Directions in which the map improves a variance by a smaller part than this do not count. */
#define UNTOLD PLR_R(0.01)

void plr_map_check_clear(plr_filter *f) {
    memset(&f->map_check, 0, sizeof f->map_check);
}

/* C <- A C A^T, with A = diag(R, R): from the body's axes to the world's. */
static void to_world(const plr_filter *f, plr_real C[PLR_POSE_SQUARE]) {
    plr_real A[PLR_POSE_SQUARE] = {0}, turned[PLR_POSE_SQUARE];
    for (unsigned r = 0; r < 3; r++)
        for (unsigned c = 0; c < 3; c++)
            A[PLR_POSE_DIM * r + c] = A[PLR_POSE_DIM * (3 + r) + 3 + c] = f->R_WB[3 * r + c];
    plr_sandwich6(turned, A, C);
    memcpy(C, turned, sizeof turned);
}

/* V += the part of the pose's error that is the calibration's. */
static void add_calibration(const plr_filter *f, plr_real V[PLR_POSE_SQUARE]) {
    plr_real C[PLR_POSE_SQUARE] = {0};
    plr_sensitivity_add_to_pose(f, C);
    to_world(f, C);
    for (unsigned i = 0; i < PLR_POSE_SQUARE; i++)
        V[i] += C[i];
}

/* Then it is the twists that the map corrects. */
static bool twists_are_off(const plr_filter *f) {
    return f->consistency.contradicted || f->consistency.drifting;
}

bool plr_map_check_begin(plr_filter *f, unsigned adopted, unsigned n, plr_map_check_pose *before) {
    unsigned known = 0;
    if (f->config.model != PLR_MODEL_BODY || (adopted == 0 && f->map_check.frames == 0))
        return false;
    for (unsigned k = 0; k < n; k++)
        known += f->work.slot_of[k] != PLR_NO_SLOT && f->slots[f->work.slot_of[k]].known;
    if (adopted >= LEAST && 2 * adopted >= known) {
        plr_map_check_clear(f);
        f->map_check.frames = FRAMES;
        add_calibration(f, f->map_check.V);
    }
    if (known == 0 || twists_are_off(f))
        plr_map_check_clear(f);
    if (f->map_check.frames == 0)
        return false;
    memcpy(before->R_WB, f->R_WB, sizeof before->R_WB);
    memcpy(before->p_WB, f->p_WB, sizeof before->p_WB);
    plr_motion_pose_covariance(f, before->P_xi);
    return true;
}

/* C <- U^-T C U^-1, symmetric */
static void in_units_of(const plr_real *U, plr_real C[PLR_POSE_SQUARE]) {
    for (unsigned twice = 0; twice < 2; twice++) {
        plr_real half[PLR_POSE_SQUARE];
        memcpy(half, C, sizeof half);
        plr_solve_upper_transposed(PLR_POSE_DIM, PLR_POSE_DIM, U, half, PLR_POSE_DIM);
        for (unsigned r = 0; r < PLR_POSE_DIM; r++)
            for (unsigned c = 0; c < PLR_POSE_DIM; c++)
                C[PLR_POSE_DIM * r + c] = half[PLR_POSE_DIM * c + r];
    }
}

/* y = U^T x */
static void out_of_units(const plr_real *U, const plr_real x[PLR_POSE_DIM],
                         plr_real y[PLR_POSE_DIM]) {
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        y[k] = 0;
        for (unsigned l = 0; l <= k; l++)
            y[k] = PLR_FMA(U[plr_upper_row(PLR_POSE_DIM, l) + k - l], x[l], y[k]);
    }
}

/* Adds a frame's correction, and the variance that it should have: P before less P after. In the
 * world's axes, so that the body may turn meanwhile. */
static void add_correction(plr_filter *f, const plr_map_check_pose *before,
                           plr_real after[PLR_POSE_SQUARE]) {
    plr_real moved[PLR_POSE_DIM], in_world[3], C[PLR_POSE_SQUARE];
    plr_pose_moved_from(f, before->R_WB, before->p_WB, moved);
    for (unsigned half = 0; half < PLR_POSE_DIM; half += 3) {
        plr_mat3_vec(in_world, f->R_WB, moved + half);
        for (unsigned i = 0; i < 3; i++)
            f->map_check.moved[half + i] += in_world[i];
    }
    for (unsigned i = 0; i < PLR_POSE_SQUARE; i++)
        C[i] = before->P_xi[i] - after[i];
    to_world(f, C);
    for (unsigned i = 0; i < PLR_POSE_SQUARE; i++)
        f->map_check.V[i] += C[i];
}

/* The sum of the corrections in sigmas of the pose as it was when the map came in sight, v, and
 * squared in its own: the result. n: by how much the map would have moved it alone, m and rad in
 * the body. */
static plr_real judge(const plr_filter *f, const plr_real after[PLR_POSE_SQUARE],
                      plr_real v[PLR_POSE_DIM], plr_real n[PLR_POSE_DIM], plr_real *noise) {
    plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN], V[PLR_POSE_TRIANGLE], C[PLR_POSE_SQUARE],
        due[PLR_POSE_SQUARE], by_map[PLR_POSE_DIM], n_W[PLR_POSE_DIM], d2 = 0;
    memcpy(due, f->map_check.V, sizeof due);
    add_calibration(f, due); /* of before and of now: the map puts one in the place of the other */
    for (unsigned i = 0; i < PLR_POSE_SQUARE; i++)
        C[i] = due[i] + after[i];
    plr_upper6_pack(U, C);
    if (!plr_cholesky_upper(PLR_POSE_DIM, U)) /* the pose was known exactly */
        return 0;
    memcpy(v, f->map_check.moved, PLR_POSE_DIM * sizeof *v);
    plr_solve_upper_transposed(PLR_POSE_DIM, 1, U, v, 1);
    in_units_of(U, due);
    plr_upper6_pack(V, due);
    plr_by_pictures_alone(v, V, UNTOLD, by_map);
    *noise = 0;
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        d2 = PLR_FMA(v[k], by_map[k], d2);
        *noise += V[plr_upper_row(PLR_POSE_DIM, k)];
    }
    out_of_units(U, by_map, n_W);
    plr_mat3_tvec(n, f->R_WB, n_W);
    plr_mat3_tvec(n + 3, f->R_WB, n_W + 3);
    return d2;
}

bool plr_map_check_end(plr_filter *f, const plr_map_check_pose *before) {
    plr_real after[PLR_POSE_SQUARE], v[PLR_POSE_DIM], n[PLR_POSE_DIM], noise;
    if (twists_are_off(f)) {
        plr_map_check_clear(f);
        return false;
    }
    plr_motion_pose_covariance(f, after);
    add_correction(f, before, after);
    to_world(f, after);
    f->map_check.frames--;
    if (!(judge(f, after, v, n, &noise) > DISAGREES_ABOVE))
        return false;
    plr_consistency_cover(f, n, v, noise);
    plr_map_check_clear(f);
    return true;
}
