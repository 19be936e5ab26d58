// SPDX-License-Identifier: MIT
#include "known_map/find.h"

#include <string.h>

#include "known_map/lookup.h"
#include "math/dense.h"
#include "math/se3.h"
#include "math/small.h"
#include "math/so3.h"
#include "sensor/stereo.h"
#include "state/calibration.h"
#include "state/motion.h"
#include "state/pose.h"
#include "state/sensitivity.h"
#include "state/sightings.h"

/* So many landmarks fit into work.Vt. */
#define ROOM (sizeof(((plr_workspace *)0)->Vt) / (sizeof(plr_seen_known)))

/* The known landmarks of the frame, or those that have just come in; those with the lowest ids
 * first. `origin`: where the first one lies, m. Returns how many. */
static unsigned collect(const plr_belief *belief, const plr_camera_model *camera,
                        const plr_map *map, const plr_sightings *sightings, bool new_ones_alone,
                        plr_seen_known *seen, double origin[3]) {
    unsigned count = 0;
    for (unsigned k = 0; k < sightings->count && count < PLR_PLACING_MOST && count < ROOM; k++) {
        const plr_sighting *s = &sightings->at[k];
        plr_landmark known;
        if (new_ones_alone && !(plr_is_matched(s) && plr_has_just_come_in(belief, s->slot)))
            continue;
        if (!plr_map_ask(map, s->seen->id, &known))
            continue;
        if (count == 0)
            memcpy(origin, known.p_W_m, sizeof known.p_W_m);
        for (unsigned i = 0; i < 3; i++)
            seen[count].w[i] = (plr_real)(known.p_W_m[i] - origin[i]);
        for (unsigned i = 0; i < 9; i++)
            seen[count].P[i] = (plr_real)known.P_W_m2[i];
        plr_stereo_rows(seen[count].z, s->seen);
        seen[count].gap_d2 = plr_stereo_row_gap_d2(camera, s->seen);
        seen[count++].k = (uint16_t)k;
    }
    return count;
}

/* The present pose, without its covariance. */
static void guess_placing(const plr_belief *belief, const plr_camera_model *camera,
                          const double origin[3], plr_placing *guess) {
    plr_real offset_W[3], offset_C[3], R_CB[9], t_CB[3];
    for (unsigned i = 0; i < 3; i++)
        offset_W[i] = (plr_real)(origin[i] - belief->p_WB[i]);
    plr_calibration_place(camera, R_CB, t_CB);
    plr_mat3_mul_nt(guess->R, R_CB, belief->R_WB);
    plr_mat3_vec(offset_C, guess->R, offset_W);
    for (unsigned i = 0; i < 3; i++)
        guess->t[i] = offset_C[i] + t_CB[i];
}

/* T_WB = T_WC T_CB. Where T_WB Exp(xi) is the truth, (rho, theta) of the camera is -Ad(T_CB) xi. */
static void set_found(const plr_camera_model *camera, const plr_placing *at, const double origin[3],
                      plr_found_pose *found) {
    plr_real offset_C[3], offset_W[3], A[PLR_POSE_SQUARE], R_CB[9], t_CB[3];
    plr_calibration_place(camera, R_CB, t_CB);
    for (unsigned i = 0; i < 3; i++)
        offset_C[i] = t_CB[i] - at->t[i];
    plr_mat3_tvec(offset_W, at->R, offset_C);
    for (unsigned i = 0; i < 3; i++)
        found->p_WB[i] = origin[i] + (double)offset_W[i];
    plr_mat3_mul_tn(found->R_WB, at->R, R_CB);
    plr_so3_orthonormalise(found->R_WB);
    plr_se3_adjoint_inverse(A, R_CB, t_CB);
    plr_sandwich6(found->P_xi, A, at->P_C);
}

bool plr_find_pose(const plr_belief *belief, const plr_camera_model *camera, const plr_map *map,
                   plr_real *Vt, const plr_sightings *sightings, bool guesses,
                   plr_found_pose *found) {
    double origin[3];
    plr_placing guess, at;
    found->count = collect(belief, camera, map, sightings, false, plr_seen_known_of(Vt), origin);
    if (found->count < PLR_PLACING_LEAST)
        return false;
    if (guesses)
        guess_placing(belief, camera, origin, &guess);
    const unsigned agreeing =
        plr_place(camera, plr_seen_known_of(Vt), found->count, guesses ? &guess : NULL, &at);
    if (agreeing == 0 || 5 * agreeing < 3 * found->count)
        return false;
    set_found(camera, &at, origin, found);
    return true;
}

bool plr_find_likeliest_pose(const plr_belief *belief, const plr_camera_model *camera,
                             const plr_motion *motion, const plr_map *map, plr_real *Vt,
                             const plr_sightings *sightings, plr_found_pose *found) {
    double origin[3];
    plr_real P[PLR_POSE_SQUARE], A[PLR_POSE_SQUARE], R_CB[9], t_CB[3];
    plr_placing prior, at;
    found->count = collect(belief, camera, map, sightings, true, plr_seen_known_of(Vt), origin);
    if (found->count == 0)
        return false;
    guess_placing(belief, camera, origin, &prior);
    plr_motion_pose_covariance(belief, motion, P);
    plr_calibration_place(camera, R_CB, t_CB);
    plr_se3_adjoint(A, R_CB, t_CB);
    plr_sandwich6(prior.P_C, A, P);
    const unsigned agreeing =
        plr_place_by_prior(camera, plr_seen_known_of(Vt), found->count, &prior, &at);
    if (5 * agreeing < 3 * found->count)
        return false;
    memset(at.P_C, 0, sizeof at.P_C);
    set_found(camera, &at, origin, found);
    return true;
}

/* The ratios of the variances. */
static void compare(const plr_real P[PLR_POSE_SQUARE], const plr_real P_found[PLR_POSE_SQUARE],
                    plr_pose_gap *gap) {
    gap->least = PLR_TOO_WIDE;
    gap->largest = 0;
    for (unsigned i = 0; i < PLR_POSE_SQUARE; i += PLR_POSE_DIM + 1) {
        if (P[i] < gap->least * P_found[i])
            gap->least = P[i] / P_found[i];
        if (P[i] > gap->largest * P_found[i] && P_found[i] > 0)
            gap->largest = P[i] / P_found[i];
    }
}

bool plr_find_gap(const plr_belief *belief, const plr_camera_model *camera,
                  const plr_motion *motion, const plr_found_pose *found, plr_pose_gap *gap) {
    plr_real P[PLR_POSE_SQUARE], sum[PLR_POSE_SQUARE], y[PLR_POSE_DIM],
        U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN];
    plr_motion_pose_covariance(belief, motion, P);
    compare(P, found->P_xi, gap);
    plr_sensitivity_add_to_pose(belief, camera, motion, P);
    for (unsigned i = 0; i < PLR_POSE_SQUARE; i++)
        sum[i] = P[i] + found->P_xi[i];
    plr_upper6_pack(U, sum);
    if (!plr_cholesky_upper(PLR_POSE_DIM, U))
        return false;
    plr_pose_towards(belief, found->R_WB, found->p_WB, gap->xi);
    memcpy(gap->nu, gap->xi, sizeof gap->nu);
    plr_solve_upper_transposed(PLR_POSE_DIM, 1, U, gap->nu, 1);
    memcpy(y, gap->nu, sizeof y);
    plr_solve_upper(PLR_POSE_DIM, U, y);
    plr_mat6_vec(gap->back, found->P_xi, y);
    return true;
}
