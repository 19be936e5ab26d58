// SPDX-License-Identifier: MIT
#include "odometry.h"

#include <math.h>
#include <stddef.h>

static const float COS_PITCH_LEAST = 0.05F; /* 3 degrees from straight up or down */

/* R_FRD = M R M, with the signs m of M's diagonal. */
static void turn(float out[9], const double R[9], const float m[3]) {
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j < 3; j++)
            out[3 * i + j] = m[i] * (float)R[3 * i + j] * m[j];
}

/* Shepperd's method: divides by the largest of the four components. */
static void quaternion(float q[4], const float R[9]) {
    const float trace = R[0] + R[4] + R[8];
    if (trace > 0.0F) {
        const float s = 2.0F * __builtin_sqrtf(1.0F + trace);
        q[0] = 0.25F * s;
        q[1] = (R[7] - R[5]) / s;
        q[2] = (R[2] - R[6]) / s;
        q[3] = (R[3] - R[1]) / s;
        return;
    }
    const unsigned i = R[4] > R[0] ? (R[8] > R[4] ? 2 : 1) : (R[8] > R[0] ? 2 : 0);
    const unsigned j = (i + 1) % 3, k = (i + 2) % 3;
    const float s = 2.0F * __builtin_sqrtf(1.0F + R[4 * i] - R[4 * j] - R[4 * k]);
    q[1 + i] = 0.25F * s;
    q[0] = (R[3 * k + j] - R[3 * j + k]) / s;
    q[1 + j] = (R[3 * j + i] + R[3 * i + j]) / s;
    q[1 + k] = (R[3 * k + i] + R[3 * i + k]) / s;
    if (q[0] < 0.0F)
        for (unsigned n = 0; n < 4; n++)
            q[n] = -q[n];
}

/* E of odometry.h, from R = Rz(yaw) Ry(pitch) Rx(roll): R32 = sr cp, R33 = cr cp, R31 = -sp. False
 * where it has no meaning. */
static bool euler_rates(float E[9], const float R[9]) {
    const float cp = __builtin_sqrtf(R[7] * R[7] + R[8] * R[8]);
    if (!(cp > COS_PITCH_LEAST))
        return false;
    const float sr = R[7] / cp, cr = R[8] / cp, tp = -R[6] / cp;
    const float rates[9] = {1.0F, sr * tp, cr * tp, 0.0F, cr, -sr, 0.0F, sr / cp, cr / cp};
    for (unsigned i = 0; i < 9; i++)
        E[i] = rates[i];
    return true;
}

/* A 6x6 from its packed lower triangle, with the signs of M on both halves. */
static void unpack(float P[6][6], const double packed[21], const float m[3]) {
    for (unsigned i = 0, k = 0; i < 6; i++)
        for (unsigned j = 0; j <= i; j++, k++)
            P[i][j] = P[j][i] = m[i % 3] * (float)packed[k] * m[j % 3];
}

/* The upper triangle, row by row. */
static void pack_upper(float upper[21], float P[6][6]) {
    for (unsigned i = 0, k = 0; i < 6; i++)
        for (unsigned j = i; j < 6; j++)
            upper[k++] = P[i][j];
}

/* P <- J P J^T with J = diag(A, B): 3x3 each. */
static void transform(float P[6][6], const float A[9], const float B[9]) {
    float JP[6][6];
    for (unsigned i = 0; i < 6; i++) {
        const float *J = i < 3 ? A : B;
        const unsigned row = i % 3, half = i - row;
        for (unsigned j = 0; j < 6; j++)
            JP[i][j] = J[3 * row] * P[half][j] + J[3 * row + 1] * P[half + 1][j] +
                       J[3 * row + 2] * P[half + 2][j];
    }
    for (unsigned j = 0; j < 6; j++) {
        const float *J = j < 3 ? A : B;
        const unsigned row = j % 3, half = j - row;
        for (unsigned i = 0; i < 6; i++)
            P[i][j] = JP[i][half] * J[3 * row] + JP[i][half + 1] * J[3 * row + 1] +
                      JP[i][half + 2] * J[3 * row + 2];
    }
}

/* As MAVLink says that a covariance is not known. */
static void set_unknown(float packed[21]) {
    for (unsigned i = 0; i < 21; i++)
        packed[i] = NAN;
}

static int8_t quality_of(plr_health health) {
    switch (health) {
    case PLR_HEALTH_GOOD:
        return 100;
    case PLR_HEALTH_DEGRADED:
        return 50;
    case PLR_HEALTH_LOST:
        return 1;
    case PLR_HEALTH_DIVERGED:
        break;
    }
    return -1;
}

plr_status plr_odometry_from_pose(plr_odometry *o, const plr_pose_message *pose, plr_body_axes axes,
                                  plr_health health) {
    if (o == NULL || pose == NULL || axes > PLR_AXES_FRD)
        return PLR_E_ARGUMENT;
    const float sign = axes == PLR_AXES_FLU ? -1.0F : 1.0F;
    const float m[3] = {1.0F, sign, sign};
    float R[9], E[9], P[6][6];
    o->time_us = pose->t_ns / 1000U;
    o->reset_counter = (uint8_t)(pose->reset_count & 0xFFU);
    o->quality = quality_of(health);
    for (unsigned i = 0; i < 3; i++) {
        o->p[i] = m[i] * (float)pose->T_WB.p[i];
        o->v[i] = m[i] * (float)pose->velocity.v_B_mps[i];
        o->w[i] = m[i] * (float)pose->velocity.w_B_radps[i];
    }
    turn(R, pose->T_WB.R, m);
    quaternion(o->q, R);
    const bool known = pose->P_xi[0] < PLR_WIRE_UNKNOWN_VARIANCE; /* it has not diverged */
    unpack(P, pose->P_u, m);
    if (known)
        pack_upper(o->velocity_covariance, P);
    else
        set_unknown(o->velocity_covariance);
    unpack(P, pose->P_xi, m);
    if (known && euler_rates(E, R)) {
        transform(P, R, E);
        pack_upper(o->pose_covariance, P);
    } else {
        set_unknown(o->pose_covariance);
    }
    return PLR_OK;
}
