// SPDX-License-Identifier: MIT
#include "textbook.h"

#include <cblas.h>
#include <lapacke.h>
#include <stdlib.h>
#include <string.h>

enum { POSE_AND_BIAS = 12, ROWS = 4 };

static float *zeros(int rows, int columns) {
    return calloc((size_t)rows * (size_t)columns, sizeof(float));
}

/* Every landmark has its own three columns, and all rows see the pose. */
static void fill(textbook *t, int n_landmarks) {
    for (int i = 0; i < t->n; i++)
        t->P[i * t->n + i] = 1e-2F;
    for (int l = 0; l < n_landmarks; l++)
        for (int r = 0; r < ROWS; r++) {
            float *row = t->H + (ROWS * l + r) * t->n;
            for (int c = 0; c < 6; c++)
                row[c] = 10.0F + (float)((7 * l + 3 * r + c) % 11);
            for (int c = 0; c < 3; c++)
                row[POSE_AND_BIAS + 3 * l + c] = 20.0F + (float)((5 * l + r + 2 * c) % 13);
        }
    for (int i = 0; i < t->m; i++)
        t->r[i] = 0.1F * (float)(i % 7 - 3);
}

bool textbook_init(textbook *t, int n_landmarks, bool symmetric) {
    t->n = POSE_AND_BIAS + 3 * n_landmarks;
    t->m = ROWS * n_landmarks;
    t->symmetric = symmetric;
    t->P = zeros(t->n, t->n);
    t->P_next = zeros(t->n, t->n);
    t->H = zeros(t->m, t->n);
    t->PHt = zeros(t->n, t->m);
    t->S = zeros(t->m, t->m);
    t->K = zeros(t->n, t->m);
    t->I_KH = zeros(t->n, t->n);
    t->r = zeros(t->m, 1);
    t->dx = zeros(t->n, 1);
    if (!t->P || !t->P_next || !t->H || !t->PHt || !t->S || !t->K || !t->I_KH || !t->r || !t->dx) {
        textbook_free(t);
        return false;
    }
    fill(t, n_landmarks);
    return true;
}

void textbook_free(textbook *t) {
    free(t->P);
    free(t->P_next);
    free(t->H);
    free(t->PHt);
    free(t->S);
    free(t->K);
    free(t->I_KH);
    free(t->r);
    free(t->dx);
    memset(t, 0, sizeof *t);
}

static void gain_form(textbook *t) {
    const int n = t->n, m = t->m;
    memcpy(t->K, t->PHt, (size_t)n * (size_t)m * sizeof *t->K);
    /* K^T = S^-1 (P H^T)^T: row-major K is column-major K^T */
    LAPACKE_spotrs(LAPACK_COL_MAJOR, 'U', m, n, t->S, m, t->K, m);
    cblas_sgemv(CblasRowMajor, CblasNoTrans, n, m, 1, t->K, m, t->r, 1, 0, t->dx, 1);
    memset(t->I_KH, 0, (size_t)n * (size_t)n * sizeof *t->I_KH);
    for (int i = 0; i < n; i++)
        t->I_KH[i * n + i] = 1;
    cblas_sgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, n, n, m, -1, t->K, m, t->H, n, 1,
                t->I_KH, n);
    cblas_sgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, n, n, n, 1, t->I_KH, n, t->P, n, 0,
                t->P_next, n);
    float *swap = t->P;
    t->P = t->P_next;
    t->P_next = swap;
}

static void symmetric_form(textbook *t) {
    const int n = t->n, m = t->m;
    memcpy(t->K, t->PHt, (size_t)n * (size_t)m * sizeof *t->K);
    cblas_strsm(CblasRowMajor, CblasRight, CblasLower, CblasTrans, CblasNonUnit, n, m, 1, t->S, m,
                t->K, m);
    cblas_strsv(CblasRowMajor, CblasLower, CblasNoTrans, CblasNonUnit, m, t->S, m, t->r, 1);
    cblas_sgemv(CblasRowMajor, CblasNoTrans, n, m, 1, t->K, m, t->r, 1, 0, t->dx, 1);
    cblas_ssyrk(CblasRowMajor, CblasLower, CblasNoTrans, n, m, -1, t->K, m, 1, t->P, n);
    for (int i = 0; i < n; i++)
        for (int j = 0; j < i; j++)
            t->P[j * n + i] = t->P[i * n + j];
}

bool textbook_update(textbook *t) {
    const int n = t->n, m = t->m;
    for (int i = 0; i < n; i++)
        t->P[i * n + i] += 1e-3F; /* as much as a predict would add, or more */
    cblas_sgemm(CblasRowMajor, CblasNoTrans, CblasTrans, n, m, n, 1, t->P, n, t->H, n, 0, t->PHt,
                m);
    cblas_sgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, m, m, n, 1, t->H, n, t->PHt, m, 0, t->S,
                m);
    for (int i = 0; i < m; i++)
        t->S[i * m + i] += 1;
    if (LAPACKE_spotrf(LAPACK_COL_MAJOR, 'U', m, t->S, m) != 0)
        return false;
    if (t->symmetric)
        symmetric_form(t);
    else
        gain_form(t);
    return true;
}
