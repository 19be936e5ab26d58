// SPDX-License-Identifier: MIT
#include "process/velocity.h"

#include <string.h>

#include "math/dense.h"
#include "math/small.h"
#include "pelorus/assertions.h"
#include "state/blocks.h"
#include "state/covariance.h"
#include "state/seconds.h"

/* If the next reading does not come, the last one is held for so many of the sensor's intervals. */
enum { HOLDS_INTERVALS = 2 };

/* A velocity that was measured longer ago than this says too little about the present one. */
#define LONGEST_INTERVAL_NS UINT64_C(500000000)
/* A held velocity that differs from a step by more is dropped until the next reading: it would be
 * one step in 5,000 by chance. In units of the setting gate-d2. */
#define CONTRADICTED PLR_R(1.5)

/* ns between readings: 0 where not known yet, or too long. Two of one time share their interval. */
static plr_time_ns interval_of(const plr_held_velocity *held, plr_time_ns t_ns) {
    if (!held->known || t_ns < held->t_ns)
        return 0;
    if (t_ns == held->t_ns)
        return held->interval_ns;
    const plr_time_ns interval = t_ns - held->t_ns;
    return interval <= LONGEST_INTERVAL_NS ? interval : 0;
}

void plr_velocity_hold(const plr_belief *belief, plr_source *source, unsigned which,
                       const plr_twist_rows *rows) {
    PLR_ASSERT(which < PLR_HELD_VELOCITIES);
    if (!source->velocities_known)
        plr_velocity_forget(source);
    plr_held_velocity *held = &source->velocities.held[which];
    const plr_time_ns before = held->interval_ns, interval = interval_of(held, belief->t_ns);
    /* where a reading was lost or rejected, the interval of before */
    const plr_time_ns usual = before > 0 && before < interval ? before : interval;
    held->interval_ns = interval;
    held->known = source->velocities_known = 1;
    held->t_ns = belief->t_ns;
    held->until_ns = belief->t_ns + HOLDS_INTERVALS * usual;
    memcpy(held->z, rows->z, sizeof held->z);
    memcpy(held->M, rows->M, sizeof held->M);
    for (unsigned r = 0; r < PLR_ROWS; r++)
        held->density[r] = rows->R[r] * plr_seconds(held->interval_ns);
}

void plr_velocity_forget(plr_source *source) {
    source->velocities_known = 0;
    memset(&source->velocities, 0, sizeof source->velocities);
}

void plr_velocity_forget_bias(plr_source *source) {
    if (!source->velocities_known)
        return;
    memset(source->velocities.bias_Lambda, 0, sizeof source->velocities.bias_Lambda);
    memset(source->velocities.bias_eta, 0, sizeof source->velocities.bias_eta);
}

/* For a step from the filter's time to end_ns. */
static bool holds(const plr_belief *belief, const plr_held_velocity *held, plr_time_ns end_ns) {
    return held->known && belief->t_ns >= held->t_ns && end_ns <= held->until_ns;
}

bool plr_velocity_is_held(const plr_belief *belief, const plr_source *source, plr_time_ns end_ns) {
    for (unsigned i = 0; source->velocities_known && i < PLR_HELD_VELOCITIES; i++)
        if (holds(belief, &source->velocities.held[i], end_ns))
            return true;
    return false;
}

/* Lambda += Y^T Y, eta += Y^T e for e = U^-T (s z - M xi) = Y db + N(0, I), Y = -s U^-T M T. */
static void add_bias_information(plr_source *source, const plr_real Y[PLR_ROWS * PLR_POSE_DIM],
                                 const plr_real e[PLR_ROWS]) {
    plr_real *eta = source->velocities.bias_eta, *Lambda = source->velocities.bias_Lambda;
    for (unsigned r = 0; r < PLR_ROWS; r++)
        for (unsigned i = 0; i < PLR_BIAS_DIM; i++) {
            const plr_real *y = Y + PLR_POSE_DIM * r;
            eta[i] = PLR_FMA(y[i], e[r], eta[i]);
            for (unsigned j = 0; j < PLR_BIAS_DIM; j++)
                Lambda[PLR_BIAS_DIM * i + j] = PLR_FMA(y[i], y[j], Lambda[PLR_BIAS_DIM * i + j]);
        }
}

/* V <- J V J^T + K R K^T with J = I - K M: positive by construction. T <- J T. */
static void correct(plr_real V[PLR_POSE_SQUARE], plr_real T[PLR_POSE_SQUARE],
                    const plr_real Kt[PLR_ROWS * PLR_POSE_DIM], const plr_held_velocity *held,
                    const plr_real R[PLR_ROWS]) {
    plr_real J[PLR_POSE_SQUARE] = {0}, next[PLR_POSE_SQUARE];
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        for (unsigned j = 0; j < PLR_POSE_DIM; j++) {
            plr_real *to = &J[PLR_POSE_DIM * i + j];
            *to = i == j ? PLR_R(1) : PLR_R(0);
            for (unsigned r = 0; r < PLR_ROWS; r++)
                *to = PLR_FMA(-Kt[PLR_POSE_DIM * r + i], held->M[PLR_POSE_DIM * r + j], *to);
        }
    plr_sandwich6(next, J, V);
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        for (unsigned j = 0; j < PLR_POSE_DIM; j++) {
            plr_real sum = next[PLR_POSE_DIM * i + j];
            for (unsigned r = 0; r < PLR_ROWS; r++)
                sum = PLR_FMA(R[r] * Kt[PLR_POSE_DIM * r + i], Kt[PLR_POSE_DIM * r + j], sum);
            V[PLR_POSE_DIM * i + j] = sum;
        }
    plr_mat6_mul(next, J, T);
    memcpy(T, next, sizeof next);
}

/* e = s z - M xi, S = M V M^T + s density. Rounding in M V M^T adds to the noise. */
static void compare(const plr_held_velocity *held, plr_real seconds,
                    const plr_real xi[PLR_POSE_DIM], const plr_real V[PLR_POSE_SQUARE],
                    plr_real MV[PLR_ROWS * PLR_POSE_DIM], plr_real R[PLR_ROWS],
                    plr_real e[PLR_ROWS], plr_real S[9]) {
    memset(S, 0, 9 * sizeof *S);
    plr_sandwich3(S, MV, held->M, V);
    for (unsigned r = 0; r < PLR_ROWS; r++) {
        R[r] = PLR_FMA(PLR_R(64) * PLR_EPSILON, S[4 * r], held->density[r] * seconds);
        e[r] = seconds * held->z[r];
        for (unsigned c = 0; c < PLR_POSE_DIM; c++)
            e[r] = PLR_FMA(-held->M[PLR_POSE_DIM * r + c], xi[c], e[r]);
        S[4 * r] += R[r];
    }
}

/* U of U^T U = S + Y P_b Y^T; Y NULL: of S alone. */
static bool factorise(const plr_belief *belief, const plr_real S[9],
                      const plr_real Y[PLR_ROWS * PLR_POSE_DIM], plr_real U[6]) {
    plr_real sum[9];
    memcpy(sum, S, sizeof sum);
    if (Y) {
        plr_real P_b[PLR_POSE_SQUARE], YP[PLR_ROWS * PLR_POSE_DIM];
        plr_covariance_get(belief, PLR_BLOCK_BIAS, PLR_BLOCK_BIAS, P_b);
        plr_sandwich3(sum, YP, Y, P_b);
    }
    return plr_factorise3(U, sum);
}

/* Is the difference e more than noise and the biases' uncertainty explain? Y = -s M T. */
static bool contradicts(const plr_belief *belief, const plr_source *source, const plr_real S[9],
                        const plr_real Y[PLR_ROWS * PLR_POSE_DIM], const plr_real e[PLR_ROWS]) {
    plr_real U[6], x[PLR_ROWS];
    if (!factorise(belief, S, plr_has_block(belief, PLR_BLOCK_BIAS) ? Y : NULL, U))
        return true;
    memcpy(x, e, sizeof x);
    plr_solve3_transposed(1, U, x);
    const plr_real d2 = plr_dot3(x, x);
    return !plr_is_finite(d2) || (source->gate_d2 > 0 && d2 > CONTRADICTED * source->gate_d2);
}

/* Corrects a step by one held velocity: s z = M xi + noise of variance s density. */
static void fuse_one(const plr_belief *belief, plr_source *source, plr_held_velocity *held,
                     plr_real seconds, plr_real xi[PLR_POSE_DIM], plr_real V[PLR_POSE_SQUARE],
                     plr_real T[PLR_POSE_SQUARE]) {
    plr_real Kt[PLR_ROWS * PLR_POSE_DIM], Y[PLR_ROWS * PLR_POSE_DIM] = {0};
    plr_real S[9], U[6], e[PLR_ROWS], R[PLR_ROWS];
    compare(held, seconds, xi, V, Kt, R, e, S);
    plr_gemm_nn(PLR_ROWS, PLR_POSE_DIM, PLR_POSE_DIM, held->M, PLR_POSE_DIM, T, PLR_POSE_DIM, Y,
                PLR_POSE_DIM);
    for (unsigned i = 0; i < PLR_ROWS * PLR_POSE_DIM; i++)
        Y[i] *= -seconds;
    if (contradicts(belief, source, S, Y, e) || !factorise(belief, S, NULL, U)) {
        held->until_ns = held->t_ns; /* until its next reading */
        return;
    }
    plr_solve3_transposed(PLR_POSE_DIM, U, Kt);
    plr_solve3_transposed(PLR_POSE_DIM, U, Y);
    plr_solve3_transposed(1, U, e);
    if (plr_has_block(belief, PLR_BLOCK_BIAS))
        add_bias_information(source, Y, e);
    for (unsigned c = 0; c < PLR_POSE_DIM; c++) {
        for (unsigned r = 0; r < PLR_ROWS; r++)
            xi[c] = PLR_FMA(Kt[PLR_POSE_DIM * r + c], e[r], xi[c]);
        /* K^T = U^-1 (U^-T M V) */
        plr_real *k0 = Kt + c, *k1 = k0 + PLR_POSE_DIM, *k2 = k1 + PLR_POSE_DIM;
        *k2 /= U[5];
        *k1 = PLR_FMA(-U[4], *k2, *k1) / U[3];
        *k0 = PLR_FMA(-U[2], *k2, PLR_FMA(-U[1], *k1, *k0)) / U[0];
    }
    correct(V, T, Kt, held, R);
}

void plr_velocity_fuse(const plr_belief *belief, plr_source *source, plr_time_ns end_ns,
                       plr_real seconds, plr_real xi[PLR_POSE_DIM], plr_real V[PLR_POSE_SQUARE],
                       plr_real T[PLR_POSE_SQUARE]) {
    memset(T, 0, PLR_POSE_SQUARE * sizeof *T);
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        T[(PLR_POSE_DIM + 1) * i] = 1;
    for (unsigned i = 0; i < PLR_HELD_VELOCITIES; i++)
        if (holds(belief, &source->velocities.held[i], end_ns))
            fuse_one(belief, source, &source->velocities.held[i], seconds, xi, V, T);
}

/* ---------------------------------------------------------------- the biases */

bool plr_velocity_informs_bias(const plr_source *source) {
    for (unsigned i = 0; source->velocities_known && i < PLR_BIAS_DIM; i++)
        if (source->velocities.bias_Lambda[(PLR_BIAS_DIM + 1) * i] > 0)
            return true;
    return false;
}

/* With Lambda = L L^T: L^T db = L^-1 eta + N(0, I). */
void plr_velocity_bias_rows(const plr_belief *belief, const plr_source *source, unsigned part,
                            plr_rows *H, plr_real r[PLR_ROWS]) {
    plr_real L[PLR_POSE_SQUARE], y[PLR_BIAS_DIM];
    plr_factor6(L, source->velocities.bias_Lambda);
    for (unsigned k = 0; k < PLR_BIAS_DIM; k++) {
        const plr_real pivot = L[(PLR_BIAS_DIM + 1) * k];
        y[k] = source->velocities.bias_eta[k];
        for (unsigned l = 0; l < k; l++)
            y[k] = PLR_FMA(-L[PLR_BIAS_DIM * k + l], y[l], y[k]);
        y[k] = pivot > 0 ? y[k] / pivot : PLR_R(0);
    }
    H->terms = 0;
    plr_real *by_bias = plr_rows_add(H, plr_row_of(belief, PLR_BLOCK_BIAS), PLR_BIAS_DIM);
    for (unsigned i = 0; i < PLR_ROWS; i++) {
        const unsigned k = PLR_ROWS * part + i;
        r[i] = y[k];
        for (unsigned c = 0; c < PLR_BIAS_DIM; c++)
            by_bias[PLR_BIAS_DIM * i + c] = L[PLR_BIAS_DIM * c + k];
    }
}
