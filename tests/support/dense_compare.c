// SPDX-License-Identifier: MIT
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "support/dense_parts.h"
#include "support/matrices.h"
#include "support/oracle.h"
#include "support/rigid.h"
#include "support/specimens.h"

/* The charts are the filter's: what is added to a bearing's two variances depends on their basis. */
void dense_make_up_for_rounding(dense_ekf *e, const plr_frame *frame, double rounding) {
    const unsigned n = dense_dim(e);
    for (unsigned i = 0; i < e->count; i++) {
        const unsigned row = dense_row(e, i);
        double share = rounding;
        for (unsigned at = 0; at < frame->count; at++)
            if (frame->observations[at].id == e->id[i])
                share = 8 * rounding;
        double P_q[9], P_w[9], own[9], Jw[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, Ji[9];
        memcpy(Ji, Jw, sizeof Ji);
        if (dense_is_body(e)) {
            plr_real x[3];
            to_reals(x, e->x[i], 3);
            specimen_chart(x, Jw, Ji);
        }
        for (unsigned k = 0; k < 9; k++)
            P_q[k] = e->P[(row + k / 3) * n + row + k % 3];
        oracle_sandwich(3, 3, Jw, P_q, P_w);
        for (unsigned k = 0; k < 9; k++)
            P_w[k] *= k % 4 == 0 ? share : 0;
        oracle_sandwich(3, 3, Ji, P_w, own);
        for (unsigned k = 0; k < 9; k++)
            e->P[(row + k / 3) * n + row + k % 3] += own[k];
    }
}

/* The filter's slot of each of the oracle's landmarks. False if one is missing. */
static bool match(const dense_ekf *e, const plr_filter *f, unsigned slot_of[DENSE_MAX]) {
    if (e->count != f->count)
        return false;
    for (unsigned i = 0; i < e->count; i++) {
        slot_of[i] = 0;
        while (slot_of[i] < f->count && f->slots[slot_of[i]].id != e->id[i])
            slot_of[i]++;
        if (slot_of[i] == f->count)
            return false;
    }
    return true;
}

/* The filter's P in the oracle's errors and order: J P J^T. */
static double *covariance_of(const dense_ekf *e, const plr_filter *f, const unsigned *slot_of) {
    const unsigned n = dense_dim(e), first = dense_row(e, 0);
    double *P = dense_zeros(n, n), *S = dense_zeros(n, n), *J = dense_zeros(n, n);
    unpack_symmetric(P, f->P, n);
    for (unsigned i = 0; i < first; i++)
        J[i * n + i] = 1;
    for (unsigned i = 0; i < e->count; i++) {
        double Jw[9], Ji[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
        if (dense_is_body(e))
            specimen_chart(f->slots[slot_of[i]].x, Jw, Ji);
        dense_put(J, n, dense_row(e, i), first + 3 * slot_of[i], 3, 3, Ji);
    }
    oracle_sandwich(n, n, J, P, S);
    free(J);
    free(P);
    return S;
}

/* The larger one; NaN stays. */
static double larger(double a, double b) {
    return a >= b || isnan(a) ? a : b;
}

static double covariance_gap(const dense_ekf *e, const double *P) {
    const unsigned n = dense_dim(e);
    double most = 0;
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j <= i; j++) {
            const double scale = sqrt(e->P[i * n + i] * e->P[j * n + j]);
            const double gap = fabs(P[i * n + j] - e->P[i * n + j]);
            if (scale > 0 || !(gap <= 0))
                most = larger(most, gap / scale);
        }
    return most;
}

static double distance(const double a[3], const double b[3]) {
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

static double rotation_gap(const dense_ekf *e, const plr_filter *f) {
    double R[9], M[16] = {0}, inverse[16], product[16], xi[6];
    to_doubles(R, f->R_WB, 9);
    for (int i = 0; i < 9; i++)
        M[4 * (i / 3) + i % 3] = R[i];
    M[15] = 1;
    rigid_inverse(inverse, e->T_WB);
    square_multiply(4, inverse, M, product);
    rigid_vee(xi, product);
    return sqrt(xi[3] * xi[3] + xi[4] * xi[4] + xi[5] * xi[5]);
}

bool dense_compare(const dense_ekf *e, const plr_filter *f, dense_gap *gap) {
    static const double origin[3] = {0, 0, 0};
    unsigned slot_of[DENSE_MAX];
    *gap = (dense_gap){0};
    if (e->pending != (f->motion.pending == 1) || !match(e, f, slot_of))
        return false;
    const double p[3] = {e->T_WB[3], e->T_WB[7], e->T_WB[11]};
    gap->position_m = distance(p, f->p_WB);
    gap->rotation_rad = rotation_gap(e, f);
    double b[6];
    to_doubles(b, f->bias, 6);
    gap->bias = largest_difference(e->bias, b, 6);
    for (unsigned i = 0; i < e->count; i++) {
        double x[3], q[3];
        to_doubles(x, f->slots[slot_of[i]].x, 3);
        dense_in_camera(e, i, q);
        gap->landmark = larger(gap->landmark, distance(e->x[i], x) / distance(q, origin));
    }
    double *P = covariance_of(e, f, slot_of);
    gap->covariance = covariance_gap(e, P);
    free(P);
    return true;
}
