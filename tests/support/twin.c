// SPDX-License-Identifier: MIT
#include "support/twin.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "support/matrices.h"
#include "support/oracle.h"
#include "support/rigid.h"
#include "support/specimens.h"
#include "textbook/observe.h"

/* The charts are the filter's: what is added to a bearing's two variances depends on their basis. */
void twin_make_up_for_rounding(textbook *t, const plr_frame *frame, double rounding) {
    for (unsigned i = 0; i < t->count; i++) {
        const unsigned row = textbook_row(t, i);
        double share = rounding;
        for (unsigned at = 0; at < frame->count; at++)
            if (frame->observations[at].id == t->landmarks[i].id)
                share = 8 * rounding;
        double P_q[9], P_w[9], own[9], Jw[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, Ji[9];
        memcpy(Ji, Jw, sizeof Ji);
        if (textbook_is_body(t)) {
            plr_real x[3];
            to_reals(x, t->landmarks[i].x, 3);
            specimen_chart(x, Jw, Ji);
        }
        for (unsigned k = 0; k < 9; k++)
            P_q[k] = textbook_covariance(t, row + k / 3, row + k % 3);
        oracle_sandwich(3, 3, Jw, P_q, P_w);
        for (unsigned k = 0; k < 9; k++)
            P_w[k] *= k % 4 == 0 ? share : 0;
        oracle_sandwich(3, 3, Ji, P_w, own);
        for (unsigned k = 0; k < 9; k++)
            if (k % 3 <= k / 3)
                t->P[(row + k / 3) * t->ld + row + k % 3] += own[k];
    }
}

/* The filter's slot of each of the textbook's landmarks. False if one is missing. */
static bool match(const textbook *t, const plr_filter *f, unsigned slot_of[PLR_MAX_LANDMARKS]) {
    if (t->count != f->belief.count)
        return false;
    for (unsigned i = 0; i < t->count; i++) {
        slot_of[i] = 0;
        while (slot_of[i] < f->belief.count && f->belief.slots[slot_of[i]].id != t->landmarks[i].id)
            slot_of[i]++;
        if (slot_of[i] == f->belief.count)
            return false;
    }
    return true;
}

/* The filter's P in the textbook's errors and order: J P J^T. */
static double *covariance_of(const textbook *t, const plr_filter *f, const unsigned *slot_of) {
    const unsigned n = textbook_dim(t), first = textbook_row(t, 0);
    double *P = specimen_zeros(n, n), *S = specimen_zeros(n, n), *J = specimen_zeros(n, n);
    unpack_symmetric(P, f->belief.P, n);
    for (unsigned i = 0; i < first; i++)
        J[i * n + i] = 1;
    for (unsigned i = 0; i < t->count; i++) {
        double Jw[9], Ji[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
        if (textbook_is_body(t))
            specimen_chart(f->belief.slots[slot_of[i]].x, Jw, Ji);
        specimen_put(J, n, textbook_row(t, i), first + 3 * slot_of[i], 3, 3, Ji);
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

static double covariance_gap(const textbook *t, const double *P) {
    const unsigned n = textbook_dim(t);
    double most = 0;
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j <= i; j++) {
            const double due = textbook_covariance(t, i, j), gap = fabs(P[i * n + j] - due);
            const double scale = sqrt(textbook_covariance(t, i, i) * textbook_covariance(t, j, j));
            if (scale > 0 || !(gap <= 0))
                most = larger(most, gap / scale);
        }
    return most;
}

static double distance(const double a[3], const double b[3]) {
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

static double rotation_gap(const textbook *t, const plr_filter *f) {
    double R[9], M[16] = {0}, inverse[16], product[16], xi[6];
    to_doubles(R, f->belief.R_WB, 9);
    for (int i = 0; i < 9; i++)
        M[4 * (i / 3) + i % 3] = R[i];
    M[15] = 1;
    rigid_inverse(inverse, t->T_WB);
    square_multiply(4, inverse, M, product);
    rigid_vee(xi, product);
    return sqrt(xi[3] * xi[3] + xi[4] * xi[4] + xi[5] * xi[5]);
}

bool twin_compare(const textbook *t, const plr_filter *f, twin_gap *gap) {
    static const double origin[3] = {0, 0, 0};
    unsigned slot_of[PLR_MAX_LANDMARKS];
    *gap = (twin_gap){0};
    if (t->pending != (f->motion.pending == 1) || !match(t, f, slot_of))
        return false;
    const double p[3] = {t->T_WB[3], t->T_WB[7], t->T_WB[11]};
    gap->position_m = distance(p, f->belief.p_WB);
    gap->rotation_rad = rotation_gap(t, f);
    double b[6];
    to_doubles(b, f->belief.bias, 6);
    gap->bias = largest_difference(t->bias, b, 6);
    for (unsigned i = 0; i < t->count; i++) {
        double x[3], q[3];
        to_doubles(x, f->belief.slots[slot_of[i]].x, 3);
        observe_in_camera(t, i, q);
        gap->landmark = larger(gap->landmark, distance(t->landmarks[i].x, x) / distance(q, origin));
    }
    double *P = covariance_of(t, f, slot_of);
    gap->covariance = covariance_gap(t, P);
    free(P);
    return true;
}

void twin_demand_same(const textbook *t, const plr_filter *f, double floor, double rounding,
                      const char *at) {
    twin_gap gap;
    TEST_ASSERT_TRUE_MESSAGE(twin_compare(t, f, &gap), at);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(floor + 500 * rounding, 0, gap.position_m, at);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(floor + 50 * rounding, 0, gap.rotation_rad, at);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(floor + 100 * rounding, 0, gap.bias, at);
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(5e-9 + 4000 * rounding, 0, gap.landmark, at);
    /* P -= V V^T leaves the rounding of the variance before in the one after, and a landmark's first
     * frames make it a thousand times smaller */
    TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-8 + 8e4 * rounding, 0, gap.covariance, at);
}

void twin_of_specimen(textbook *t, const plr_filter *f) {
    const plr_camera *camera = &f->camera.given;
    plr_calibration calibration = {.fx_px = (double)camera->fx,
                                   .fy_px = (double)camera->fy,
                                   .cx_px = (double)camera->cx,
                                   .cy_px = (double)camera->cy,
                                   .baseline_m = (double)camera->baseline};
    plr_pose T_WB;
    to_doubles(calibration.T_CB.R, camera->R_CB, 9);
    to_doubles(calibration.T_CB.p, camera->t_CB, 3);
    textbook_stand(t, &calibration, &f->config);
    if (plr_filter_pose(f, &T_WB) != PLR_OK)
        abort();
    rigid_from_pose(t->T_WB, &T_WB);
}
