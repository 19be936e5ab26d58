// SPDX-License-Identifier: MIT
#include "filter/extrinsics.h"

#include <string.h>

#include "math/dense.h"
#include "math/small.h"
#include "math/so3.h"

static bool has_arm(const plr_filter *f) {
    return plr_dot3(f->source.imu_arm, f->source.imu_arm) > 0;
}

void plr_extrinsics_set(plr_filter *f, const plr_config *config) {
    plr_real turn[3], moved[3];
    plr_mat3_identity(f->source.R_BI);
    memset(f->source.imu_arm, 0, sizeof f->source.imu_arm);
    if (config->process != PLR_PROCESS_IMU)
        return;
    for (int i = 0; i < 3; i++) {
        f->source.imu_arm[i] = (plr_real)config->imu_arm_m[i];
        turn[i] = (plr_real)config->imu_turn_rad[i];
    }
    plr_so3_exp(f->source.R_BI, turn);
    plr_mat3_vec(moved, f->camera.given.R_CB, f->source.imu_arm);
    for (int i = 0; i < 3; i++)
        f->camera.given.t_CB[i] += moved[i];
}

/* P <- A P A^T, A = [I, s [r]x; 0, I]. */
static void shift(const plr_real r[3], plr_real s, plr_real P[PLR_POSE_SQUARE]) {
    plr_real A[PLR_POSE_SQUARE] = {0}, R[9], before[PLR_POSE_SQUARE];
    plr_skew(R, r);
    for (int i = 0; i < PLR_POSE_DIM; i++)
        A[(PLR_POSE_DIM + 1) * i] = 1;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            A[PLR_POSE_DIM * i + 3 + j] = s * R[3 * i + j];
    memcpy(before, P, sizeof before);
    plr_sandwich6(P, A, before);
}

static void move(const plr_filter *f, double sign, plr_pose *T) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            T->p[i] += sign * T->R[3 * i + j] * (double)f->source.imu_arm[j];
}

void plr_extrinsics_pose_in(const plr_filter *f, plr_pose *T) {
    if (has_arm(f))
        move(f, 1, T);
}

void plr_extrinsics_covariance_in(const plr_filter *f, double P[PLR_POSE_SQUARE]) {
    plr_real in_real[PLR_POSE_SQUARE];
    if (!has_arm(f))
        return;
    for (int i = 0; i < PLR_POSE_SQUARE; i++)
        in_real[i] = (plr_real)P[i];
    shift(f->source.imu_arm, -1, in_real);
    for (int i = 0; i < PLR_POSE_SQUARE; i++)
        P[i] = (double)in_real[i];
}

void plr_extrinsics_pose_out(const plr_filter *f, plr_pose *T) {
    if (has_arm(f))
        move(f, -1, T);
}

void plr_extrinsics_covariance_out(const plr_filter *f, plr_real P[PLR_POSE_SQUARE]) {
    if (has_arm(f))
        shift(f->source.imu_arm, 1, P);
}

void plr_extrinsics_twist_out(const plr_filter *f, plr_real u[PLR_POSE_DIM], plr_real *P) {
    plr_real by_turning[3];
    if (!has_arm(f))
        return;
    plr_cross3(by_turning, f->source.imu_arm, u + 3);
    for (int i = 0; i < 3; i++)
        u[i] += by_turning[i];
    if (P)
        shift(f->source.imu_arm, 1, P);
}

void plr_extrinsics_place_in(const plr_filter *f, double at_B_m[3]) {
    for (int i = 0; i < 3 && has_arm(f); i++)
        at_B_m[i] -= (double)f->source.imu_arm[i];
}

void plr_extrinsics_reading_in(const plr_filter *f, plr_real reading[PLR_POSE_DIM]) {
    plr_real turned[PLR_POSE_DIM];
    plr_mat3_vec(turned, f->source.R_BI, reading);
    plr_mat3_vec(turned + 3, f->source.R_BI, reading + 3);
    memcpy(reading, turned, sizeof turned);
}
