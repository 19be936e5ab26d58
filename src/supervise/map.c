// SPDX-License-Identifier: MIT
#include "supervise/map.h"

#include <string.h>

#include "limits/limits.h"
#include "math/dense.h"
#include "math/small.h"
#include "supervise/sum.h"

void plr_map_forget(plr_supervisor *s) {
    memset(s->map_moved, 0, sizeof s->map_moved);
    memset(s->map_variance, 0, sizeof s->map_variance);
    s->map_frames = 0;
}

/* V += sign A C A^T, with A = diag(R, R): from the body's axes to the world's, in which the body may turn. */
static void add_in_world(const plr_real R[9], plr_real sign, const plr_real C[PLR_POSE_SQUARE],
                         plr_real V[PLR_POSE_SQUARE]) {
    plr_real A[PLR_POSE_SQUARE] = {0}, turned[PLR_POSE_SQUARE];
    for (unsigned r = 0; r < 3; r++)
        for (unsigned c = 0; c < 3; c++)
            A[PLR_POSE_DIM * r + c] = A[PLR_POSE_DIM * (3 + r) + 3 + c] = R[3 * r + c];
    plr_sandwich6(turned, A, C);
    for (unsigned i = 0; i < PLR_POSE_SQUARE; i++)
        V[i] = PLR_FMA(sign, turned[i], V[i]);
}

/* Adds the frame's correction, and the variance that it should have: P before less P after. */
static void add_correction(plr_supervisor *s, const plr_map_evidence *e) {
    plr_real in_world[3];
    for (unsigned half = 0; half < PLR_POSE_DIM; half += 3) {
        plr_mat3_vec(in_world, e->R_WB, e->moved + half);
        for (unsigned i = 0; i < 3; i++)
            s->map_moved[half + i] += in_world[i];
    }
    add_in_world(e->R_WB, 1, e->P_before, s->map_variance);
    add_in_world(e->R_WB, -1, e->P_after, s->map_variance);
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

/* The sum of the corrections in sigmas of the pose as it was when the map came in sight, and squared in its
 * own: the result. The calibration counts twice, of before and of now, because the map puts one in the place
 * of the other. */
static plr_real judge(const plr_supervisor *s, const plr_map_evidence *e, plr_map_verdict *v) {
    plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN], V[PLR_POSE_TRIANGLE], due[PLR_POSE_SQUARE],
        all[PLR_POSE_SQUARE], by_map[PLR_POSE_DIM], n_W[PLR_POSE_DIM], d2 = 0;
    memcpy(due, s->map_variance, sizeof due);
    add_in_world(e->R_WB, 1, e->calibration, due);
    memcpy(all, due, sizeof all);
    add_in_world(e->R_WB, 1, e->P_after, all);
    plr_upper6_pack(U, all);
    if (!plr_cholesky_upper(PLR_POSE_DIM, U)) /* the pose was known exactly */
        return 0;
    memcpy(v->nu, s->map_moved, sizeof v->nu);
    plr_solve_upper_transposed(PLR_POSE_DIM, 1, U, v->nu, 1);
    in_units_of(U, due);
    plr_upper6_pack(V, due);
    plr_sum_by_pictures(v->nu, V, plr_limit(s->left_out, PLR_LIMIT_UNOBSERVED), by_map);
    v->noise = 0;
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        d2 = PLR_FMA(v->nu[k], by_map[k], d2);
        v->noise += V[plr_upper_row(PLR_POSE_DIM, k)];
    }
    out_of_units(U, by_map, n_W);
    plr_mat3_tvec(v->n, e->R_WB, n_W);
    plr_mat3_tvec(v->n + 3, e->R_WB, n_W + 3);
    return d2;
}

void plr_map_add(plr_supervisor *s, const plr_map_evidence *e, plr_map_verdict *verdict) {
    verdict->disagrees = false;
    if (e->adopted >= plr_limit_count(s->left_out, PLR_LIMIT_MAP_LEAST) &&
        2 * e->adopted >= e->known) {
        plr_map_forget(s);
        s->map_frames = (uint8_t)plr_limit_count(s->left_out, PLR_LIMIT_MAP_FRAMES);
        add_in_world(e->R_WB, 1, e->calibration, s->map_variance);
    }
    /* with odometry that is off, it is that which the map corrects */
    if (e->known == 0 || s->doubt == PLR_DOUBT_CONTRADICTED || s->doubt == PLR_DOUBT_DEPARTED)
        plr_map_forget(s);
    if (s->map_frames == 0)
        return;
    add_correction(s, e);
    s->map_frames--;
    verdict->disagrees = judge(s, e, verdict) > plr_limit(s->left_out, PLR_LIMIT_MAP_ABOVE);
    if (verdict->disagrees)
        plr_map_forget(s);
}
