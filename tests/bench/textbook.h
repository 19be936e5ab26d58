// SPDX-License-Identifier: MIT
/*
 * The yardstick: one update of a dense textbook EKF in float32 on OpenBLAS. H is full, with four
 * rows an observation, all observations at once, and P is a full square matrix.
 */
#ifndef PELORUS_BENCH_TEXTBOOK_H
#define PELORUS_BENCH_TEXTBOOK_H

#include <stdbool.h>

typedef struct textbook {
    int n, m;          /* dimension of the state, rows of H: 4 a landmark */
    bool symmetric;    /* P -= V V^T by trsm and syrk, instead of P = (I - K H) P by gemm */
    float *P, *P_next; /* n x n */
    float *H, *PHt;    /* m x n, n x m */
    float *S, *K, *I_KH;
    float *r, *dx;
} textbook;

/* For n_landmarks landmarks behind 12 states of pose and bias. False if memory is short. */
bool textbook_init(textbook *t, int n_landmarks, bool symmetric);
void textbook_free(textbook *t);

/* S = H P H^T + R, potrf, then K by potrs and P = (I - K H) P by gemm; or V by trsm and P -= V V^T
 * by syrk. dx = K r. False if S is not positive. */
bool textbook_update(textbook *t);

#endif
