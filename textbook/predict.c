// SPDX-License-Identifier: MIT
/* The textbook's motion: III.8 and III.14. Landmarks stand still in the world. */
#include <cblas.h>
#include <string.h>

#include "textbook/se3.h"
#include "textbook/textbook.h"

/* The first rows of P (pose, and bias where there is one), k x k, as a full matrix. */
static void get_head(const textbook *t, unsigned k, double *B) {
    for (unsigned i = 0; i < k; i++)
        for (unsigned j = 0; j < k; j++)
            B[i * k + j] = textbook_covariance(t, i, j);
}

/* P <- F P F^T + diag(W, 0), F = diag(head, I): head is k x k, W six variances. The landmarks' own
 * block stays as it is. */
static void transport(textbook *t, unsigned k, const double *head, const double W[6]) {
    const unsigned n = textbook_dim(t);
    double B[144], FB[144], FBF[144];
    get_head(t, k, B);
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, (int)k, (int)k, (int)k, 1, head, (int)k,
                B, (int)k, 0, FB, (int)k);
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, (int)k, (int)k, (int)k, 1, FB, (int)k,
                head, (int)k, 0, FBF, (int)k);
    for (unsigned i = 0; i < k; i++)
        for (unsigned j = 0; j <= i; j++)
            t->P[i * t->ld + j] = FBF[i * k + j] + (i == j && i < 6 ? W[i] : 0);
    for (unsigned i = k; i < n; i++) { /* the landmarks' rows begin with these columns */
        double turned[12] = {0};
        double *row = t->P + i * t->ld;
        for (unsigned a = 0; a < k; a++)
            for (unsigned b = 0; b < k; b++)
                turned[a] += row[b] * head[a * k + b];
        memcpy(row, turned, k * sizeof *row);
    }
}

/* The variance that a bias walk adds, in one go before P is looked at. */
static void walk(textbook *t, double seconds) {
    for (unsigned i = 6; i < textbook_row(t, 0); i++)
        t->P[i * t->ld + i] +=
            seconds * (i < 9 ? t->config.bias_velocity_walk : t->config.bias_gyro_walk);
}

void textbook_hold(textbook *t, const plr_twist *twist, double seconds, double interval) {
    const plr_config *c = &t->config;
    const unsigned k = textbook_row(t, 0);
    const double share =
        c->noise == PLR_NOISE_STEP ? (interval > 0 ? seconds / interval : 1) : seconds * interval;
    double xi[6], D[16], back[16], moved[16], A[36], J[36], head[144] = {0}, W[6];
    for (int i = 0; i < 3; i++) {
        xi[i] = seconds * (twist->v_B_mps[i] - t->bias[i]);
        xi[3 + i] = seconds * (twist->w_B_radps[i] - t->bias[3 + i]);
        W[i] = c->velocity_sigma[i] * c->velocity_sigma[i] * share;
        W[3 + i] = c->gyro_sigma[i] * c->gyro_sigma[i] * share;
    }
    se3_exp(xi, D);
    se3_inverse(D, back);
    se3_adjoint(back, A);
    se3_right_jacobian(xi, J);
    for (unsigned i = 0; i < k; i++)
        head[i * (k + 1)] = 1;
    for (unsigned i = 0; i < 6; i++)
        for (unsigned j = 0; j < 6; j++) {
            head[i * k + j] = A[6 * i + j];
            if (c->bias)
                head[i * k + 6 + j] = -seconds * J[6 * i + j];
        }
    se3_multiply(t->T_WB, D, moved);
    memcpy(t->T_WB, moved, sizeof moved);
    se3_clean(t->T_WB);
    transport(t, k, head, W);
    walk(t, seconds);
}

void textbook_move_to(textbook *t, const plr_pose *T_WB) {
    se3_from_pose(T_WB, t->T_WB);
    se3_clean(t->T_WB);
}
