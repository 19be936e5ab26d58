// SPDX-License-Identifier: MIT
#include "textbook/transport.h"

#include <string.h>

#include "support/oracle.h"
#include "support/rigid.h"

/* The first k rows and columns. */
static void turn_head(textbook *t, unsigned k, const double *head) {
    const unsigned n = textbook_dim(t);
    double B[144], FBF[144];
    for (unsigned i = 0; i < k; i++)
        for (unsigned j = 0; j < k; j++)
            B[i * k + j] = textbook_covariance(t, i, j);
    oracle_sandwich(k, k, head, B, FBF);
    for (unsigned i = 0; i < k; i++)
        for (unsigned j = 0; j <= i; j++)
            t->P[i * t->ld + j] = FBF[i * k + j];
    for (unsigned i = k; i < n; i++) { /* the others' rows begin with these columns */
        double turned[12] = {0};
        double *row = t->P + i * t->ld;
        for (unsigned a = 0; a < k; a++)
            for (unsigned b = 0; b < k; b++)
                turned[a] += row[b] * head[a * k + b];
        memcpy(row, turned, k * sizeof *row);
    }
}

/* Columns first .. first+2 of three rows, times B^T. */
static void turn_columns(double *rows, size_t ld, const double *B) {
    for (unsigned i = 0; i < 3; i++) {
        double *x = rows + i * ld;
        const double a = x[0], b = x[1], c = x[2];
        for (unsigned j = 0; j < 3; j++)
            x[j] = a * B[3 * j] + b * B[3 * j + 1] + c * B[3 * j + 2];
    }
}

/* Three rows, up to the landmark's own columns: from the left by B, from the right by the others'. */
static void turn_landmark(textbook *t, unsigned landmark, const double *blocks) {
    const unsigned row = textbook_row(t, landmark);
    const double *B = blocks + 9 * (size_t)landmark;
    double *first = t->P + row * t->ld, *second = first + t->ld, *third = second + t->ld;
    double own[9], turned[9];
    for (unsigned j = 0; j < row; j++) {
        const double a = first[j], b = second[j], c = third[j];
        first[j] = B[0] * a + B[1] * b + B[2] * c;
        second[j] = B[3] * a + B[4] * b + B[5] * c;
        third[j] = B[6] * a + B[7] * b + B[8] * c;
    }
    for (unsigned other = 0; other < landmark; other++)
        turn_columns(first + textbook_row(t, other), t->ld, blocks + 9 * (size_t)other);
    for (unsigned k = 0; k < 9; k++)
        own[k] = textbook_covariance(t, row + k / 3, row + k % 3);
    oracle_sandwich(3, 3, B, own, turned);
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j <= i; j++)
            first[i * t->ld + row + j] = turned[3 * i + j];
}

void transport_covariance(textbook *t, unsigned k, const double *head, const double *blocks) {
    turn_head(t, k, head);
    for (unsigned landmark = 0; blocks && landmark < t->count; landmark++)
        turn_landmark(t, landmark, blocks);
}

void transport_widen(textbook *t, const double *X, const double *G) {
    const unsigned n = textbook_dim(t);
    for (unsigned i = 0; i < n; i++) {
        const double *x = X + 6 * (size_t)i, *g = G + 6 * (size_t)i;
        double *row = t->P + i * t->ld;
        for (unsigned j = 0; j <= i; j++) {
            const double *other_x = X + 6 * (size_t)j, *other_g = G + 6 * (size_t)j;
            for (unsigned a = 0; a < 6; a++)
                row[j] += x[a] * other_g[a] + g[a] * other_x[a];
        }
    }
}
