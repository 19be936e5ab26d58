// SPDX-License-Identifier: MIT
#include "math/so3.h"

#include "math/small.h"
#include "pelorus/assertions.h"

enum { TERMS = 16 }; /* at |theta| = pi the last one is below the float64 rounding */

/* 1 / (m (m + 1)) */
#define PAIR(m) PLR_R(1.0 / ((m) * ((m) + 1.0)))
static const plr_real pair[2 * TERMS + 6] = {
    PLR_R(0), PAIR(1),  PAIR(2),  PAIR(3),  PAIR(4),  PAIR(5),  PAIR(6),  PAIR(7),
    PAIR(8),  PAIR(9),  PAIR(10), PAIR(11), PAIR(12), PAIR(13), PAIR(14), PAIR(15),
    PAIR(16), PAIR(17), PAIR(18), PAIR(19), PAIR(20), PAIR(21), PAIR(22), PAIR(23),
    PAIR(24), PAIR(25), PAIR(26), PAIR(27), PAIR(28), PAIR(29), PAIR(30), PAIR(31),
    PAIR(32), PAIR(33), PAIR(34), PAIR(35), PAIR(36), PAIR(37)};

/* sum_k (-x)^k j! / (2k + j)!, nested: each term is the one before times -x / ((2k+j+1)(2k+j+2)).
 * Nesting keeps tiny factorials, which float32 cannot hold, out of the sum. */
static plr_real alternating(plr_real x, int j) {
    plr_real sum = 1;
    PLR_ASSERT(j >= 1 && j <= 5); /* pair ends there */
    for (int k = TERMS - 1; k >= 0; k--)
        sum = PLR_FMA(-x * pair[2 * k + j + 1], sum, PLR_R(1));
    return sum;
}

/* sum_k (-x)^k (k + 1) 5! / (2k + 5)!, nested likewise. */
static plr_real alternating_weighted(plr_real x) {
    plr_real sum = 1;
    for (int k = TERMS - 1; k >= 0; k--) {
        const plr_real weight = (plr_real)(k + 2) / (plr_real)(k + 1);
        sum = PLR_FMA(-x * pair[2 * k + 6] * weight, sum, PLR_R(1));
    }
    return sum;
}

void plr_so3_series_at(plr_so3_series *s, plr_real theta2) {
    s->a = alternating(theta2, 1);
    s->b = alternating(theta2, 2) * PLR_R(1.0 / 2);
    s->c = alternating(theta2, 3) * PLR_R(1.0 / 6);
    s->d = alternating(theta2, 4) * PLR_R(1.0 / 24);
    s->e = alternating_weighted(theta2) * PLR_R(1.0 / 120);
}

void plr_so3_expm1(plr_real E[9], const plr_real theta[3]) {
    const plr_real theta2 = plr_dot3(theta, theta);
    const plr_real a = alternating(theta2, 1);
    const plr_real b = alternating(theta2, 2) * PLR_R(0.5);
    plr_real W[9], WW[9];
    plr_skew(W, theta);
    plr_mat3_mul(WW, W, W);
    for (int i = 0; i < 9; i++)
        E[i] = PLR_FMA(b, WW[i], a * W[i]);
}

void plr_so3_exp(plr_real R[9], const plr_real theta[3]) {
    plr_so3_expm1(R, theta);
    for (int i = 0; i < 9; i += 4)
        R[i] += PLR_R(1);
}

void plr_so3_orthonormalise_small(plr_real E[9]) {
    plr_real S[9], ES[9];
    plr_mat3_mul_tn(S, E, E); /* (I + E)^T (I + E) - I = E + E^T + E^T E */
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            S[3 * i + j] += E[3 * i + j] + E[3 * j + i];
    plr_mat3_mul(ES, E, S);
    for (int i = 0; i < 9; i++)
        E[i] -= PLR_R(0.5) * (S[i] + ES[i]);
}

void plr_so3_orthonormalise(plr_real R[9]) {
    plr_real RtR[9], half[9], result[9];
    plr_mat3_mul_tn(RtR, R, R);
    for (int i = 0; i < 9; i++)
        half[i] = PLR_R(-0.5) * RtR[i];
    for (int i = 0; i < 9; i += 4)
        half[i] += PLR_R(1.5);
    plr_mat3_mul(result, R, half);
    memcpy(R, result, sizeof result);
}

/* The angle from tan(t / 2) = sin t / (1 + cos t), roughly; then Newton's steps, on the axis. */
PLR_SELDOM void plr_so3_log(plr_real theta[3], const plr_real R[9]) {
    plr_turn_of(theta, R);
    const plr_real sine = PLR_SQRT(plr_dot3(theta, theta));
    const plr_real cosine = PLR_R(0.5) * (R[0] + R[4] + R[8] - PLR_R(1));
    const plr_real tangent = sine / (PLR_R(1) + cosine + PLR_R(1e-3));
    const plr_real small = tangent < 1 ? tangent : PLR_R(1) / tangent;
    const plr_real arc = small * (PLR_R(0.7854) + PLR_R(0.273) * (PLR_R(1) - small));
    const plr_real angle = PLR_R(2) * (tangent < 1 ? arc : PLR_R(1.5708) - arc);
    if (!(sine > PLR_R(1e-6)))
        return; /* small, or half a turn, whose axis the sines do not give */
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
