// SPDX-License-Identifier: MIT
#include "math/se3.h"

#include "math/small.h"
#include "math/so3.h"
#include "pelorus/assertions.h"

/* A = [R, C; 0, R] */
static void put_blocks(plr_real A[36], const plr_real R[9], const plr_real C[9]) {
    PLR_ASSERT(A != R && A != C);
    memset(A, 0, 36 * sizeof *A);
    for (int i = 0; i < 3; i++) {
        memcpy(A + 6 * i, R + 3 * i, 3 * sizeof *R);
        memcpy(A + 6 * i + 3, C + 3 * i, 3 * sizeof *C);
        memcpy(A + 6 * (3 + i) + 3, R + 3 * i, 3 * sizeof *R);
    }
}

void plr_se3_expm1(plr_real E[9], plr_real p[3], const plr_real xi[6]) {
    const plr_real *rho = xi, *theta = xi + 3;
    plr_so3_series s;
    plr_so3_series_at(&s, plr_dot3(theta, theta));
    plr_so3_expm1(E, theta);
    plr_real once[3], twice[3];
    plr_cross3(once, theta, rho);
    plr_cross3(twice, theta, once);
    for (int i = 0; i < 3; i++)
        p[i] = PLR_FMA(s.c, twice[i], PLR_FMA(s.b, once[i], rho[i]));
}

void plr_se3_exp(plr_real R[9], plr_real p[3], const plr_real xi[6]) {
    plr_real E[9];
    plr_se3_expm1(E, p, xi);
    plr_se3_rotation(R, E);
}

void plr_se3_rotation(plr_real R[9], const plr_real E[9]) {
    for (int i = 0; i < 9; i++)
        R[i] = E[i] + (i % 4 == 0 ? PLR_R(1) : PLR_R(0));
}

void plr_se3_adjoint(plr_real Ad[36], const plr_real R[9], const plr_real p[3]) {
    plr_real P[9], PR[9];
    plr_skew(P, p);
    plr_mat3_mul(PR, P, R);
    put_blocks(Ad, R, PR);
}

void plr_se3_adjoint_inverse(plr_real Ad[36], const plr_real R[9], const plr_real p[3]) {
    plr_real P[9], Rt[9], RtP[9];
    const plr_real minus_p[3] = {-p[0], -p[1], -p[2]};
    plr_skew(P, minus_p);
    plr_mat3_transpose(Rt, R);
    plr_mat3_mul(RtP, Rt, P);
    put_blocks(Ad, Rt, RtP);
}

void plr_se3_right_jacobian(plr_real Jr[36], const plr_real xi[6]) {
    const plr_real *theta = xi + 3;
    plr_so3_series s;
    plr_so3_series_at(&s, plr_dot3(theta, theta));

    plr_real W[9], V[9], WW[9], WV[9], VW[9], WVW[9], WWV[9], VWW[9], WVWW[9], WWVW[9];
    plr_skew(W, theta);
    plr_skew(V, xi);
    plr_mat3_mul(WW, W, W);
    plr_mat3_mul(WV, W, V);
    plr_mat3_mul(VW, V, W);
    plr_mat3_mul(WVW, WV, W);
    plr_mat3_mul(WWV, W, WV);
    plr_mat3_mul(VWW, VW, W);
    plr_mat3_mul(WVWW, WVW, W);
    plr_mat3_mul(WWVW, W, WVW);

    plr_real J[9], Q[9];
    plr_mat3_identity(J);
    for (int i = 0; i < 9; i++) {
        J[i] = PLR_FMA(s.c, WW[i], PLR_FMA(-s.b, W[i], J[i]));
        Q[i] = PLR_R(-0.5) * V[i];
        Q[i] = PLR_FMA(s.c, WV[i] + VW[i] - WVW[i], Q[i]);
        Q[i] = PLR_FMA(-s.d, WWV[i] + VWW[i] - PLR_R(3) * WVW[i], Q[i]);
        Q[i] = PLR_FMA(s.e, WVWW[i] + WWVW[i], Q[i]);
    }
    put_blocks(Jr, J, Q);
}

void plr_se3_append(plr_real E[9], plr_real p[3], const plr_real dE[9], const plr_real dp[3]) {
    plr_real step[3], product[9];
    plr_mat3_vec(step, E, dp);
    plr_mat3_mul(product, E, dE);
    for (int i = 0; i < 3; i++)
        p[i] += dp[i] + step[i];
    for (int i = 0; i < 9; i++)
        E[i] += dE[i] + product[i];
}

void plr_se3_move_back(plr_real x[3], const plr_real E[9], const plr_real p[3]) {
    const plr_real offset[3] = {x[0] - p[0], x[1] - p[1], x[2] - p[2]};
    plr_real turn[3];
    plr_mat3_tvec(turn, E, offset);
    for (int i = 0; i < 3; i++)
        x[i] += turn[i] - p[i];
}

void plr_se3_inverse_point(plr_real y[3], const plr_real R[9], const plr_real p[3],
                           const plr_real x[3]) {
    PLR_ASSERT(y != x);
    const plr_real offset[3] = {x[0] - p[0], x[1] - p[1], x[2] - p[2]};
    plr_mat3_tvec(y, R, offset);
}
