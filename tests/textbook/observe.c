// SPDX-License-Identifier: MIT
#include "textbook/observe.h"

#include <math.h>
#include <string.h>

#include "support/oracle.h"
#include "support/rigid.h"

/* [I | -hat(s)], 3x6: the upper rows of III.12's circle-dot. */
static void circle_dot(const double s[3], double C[18]) {
    const double rows[18] = {1,     0, 0,    0, s[2], -s[1], 0,    1,     0,
                             -s[2], 0, s[0], 0, 0,    1,     s[1], -s[0], 0};
    memcpy(C, rows, sizeof rows);
}

/* z = (uL, vL, uR, vR) of a point q of the camera, and D = dz/dq, 4x3; D may be NULL. */
static void observe_project(const plr_calibration *c, const double q[3], double z[TEXTBOOK_ROWS],
                            double D[12]) {
    const double x = q[0] / q[2], y = q[1] / q[2], base = c->baseline_m / q[2];
    z[0] = c->fx_px * q[0] / q[2] + c->cx_px;
    z[1] = z[3] = c->fy_px * q[1] / q[2] + c->cy_px;
    z[2] = c->fx_px * (q[0] - c->baseline_m) / q[2] + c->cx_px;
    if (!D)
        return;
    const double rows[12] = {c->fx_px, 0, -c->fx_px * x,          0, c->fy_px, -c->fy_px * y,
                             c->fx_px, 0, -c->fx_px * (x - base), 0, c->fy_px, -c->fy_px * y};
    for (int i = 0; i < 12; i++)
        D[i] = rows[i] / q[2];
}

void observe_project3(const plr_calibration *c, const double q[3], double z[3], double D[9]) {
    static const unsigned row_of[3] = {0, 2, 1}; /* vL and vR are predicted alike */
    double z4[TEXTBOOK_ROWS], D4[12];
    observe_project(c, q, z4, D4);
    for (unsigned r = 0; r < 3; r++) {
        z[r] = z4[row_of[r]];
        memcpy(D + 3 * r, D4 + 3 * row_of[r], 3 * sizeof *D);
    }
}

void observe_camera_to_world(const textbook *t, double R_WC[9]) {
    double T_WB[16], R_WB[9], R_BC[9];
    textbook_reference(t, T_WB);
    rigid_rotation(R_WB, T_WB);
    rigid_rotation_back(R_BC, t->T_CB);
    square_multiply(3, R_WB, R_BC, R_WC);
}

void observe_world_by_pose(const textbook *t, const double s[3], double J[18]) {
    double C[18], R_WB[9], T_WB[16];
    circle_dot(s, C);
    textbook_reference(t, T_WB);
    rigid_rotation(R_WB, T_WB);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 3, 1, R_WB, C, 0, J);
}

void observe_camera_by_pose(const textbook *t, const double q[3], double K[18]) {
    double C[18];
    circle_dot(q, C);
    oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, 3, 6, 6, -1, C, t->Ad_CB, 0, K);
}

void observe_in_camera(const textbook *t, unsigned landmark, double q[3]) {
    double T_BW[16], s[3];
    memcpy(q, t->landmarks[landmark].x, 3 * sizeof *q);
    if (textbook_is_body(t))
        return;
    rigid_inverse(T_BW, t->T_WB);
    rigid_apply(s, T_BW, q);
    rigid_apply(q, t->T_CB, s);
}

bool observe_linearise(const textbook *t, unsigned landmark, const plr_observation *seen,
                       observe_line *line) {
    const double pixels[TEXTBOOK_ROWS] = {(double)seen->uL_px, (double)seen->vL_px,
                                          (double)seen->uR_px, (double)seen->vR_px};
    double q[3], z[TEXTBOOK_ROWS], D[12], K[18], H_xi[24], R_WC[9], H_m[12];
    observe_in_camera(t, landmark, q);
    if (!(q[2] >= t->config.min_depth_m))
        return false;
    observe_project(&t->camera, q, z, D);
    memcpy(H_m, D, sizeof H_m);
    memset(H_xi, 0, sizeof H_xi);
    if (!textbook_is_body(t)) {
        observe_camera_by_pose(t, q, K);
        observe_camera_to_world(t, R_WC);
        oracle_gemm(ORACLE_PLAIN, ORACLE_PLAIN, TEXTBOOK_ROWS, 6, 3, 1, D, K, 0, H_xi);
        oracle_gemm(ORACLE_PLAIN, ORACLE_TRANSPOSED, TEXTBOOK_ROWS, 3, 3, 1, D, R_WC, 0, H_m);
    }
    for (int i = 0; i < TEXTBOOK_ROWS; i++) {
        line->r[i] = pixels[i] - z[i];
        memcpy(line->H + OBSERVE_COLUMNS * i, H_xi + 6 * i, 6 * sizeof *line->H);
        memcpy(line->H + OBSERVE_COLUMNS * i + 6, H_m + 3 * i, 3 * sizeof *line->H);
    }
    return true;
}

/* vL and vR of a point are equal: their mean has half the variance. */
void observe_back_project(const textbook *t, const plr_observation *seen, double q[3],
                          double S[9]) {
    const plr_calibration *c = &t->camera;
    const double d = (double)seen->uL_px - (double)seen->uR_px, scale = c->baseline_m / d;
    const double u = (double)seen->uL_px - c->cx_px;
    const double v =
        (((double)seen->vL_px + (double)seen->vR_px) / 2 - c->cy_px) * c->fx_px / c->fy_px;
    const double sigma = t->config.pixel_sigma_px;
    q[0] = scale * u;
    q[1] = scale * v;
    q[2] = scale * c->fx_px;
    /* dq/d(uL, uR, v), the columns times the sigmas */
    for (int i = 0; i < 3; i++) {
        S[3 * i] = -q[i] / d * sigma;
        S[3 * i + 1] = q[i] / d * sigma;
        S[3 * i + 2] = 0;
    }
    S[0] += scale * sigma;
    S[5] = scale * c->fx_px / c->fy_px * sigma / sqrt(2);
}

/* docs/MATH.md 8. */
bool observe_accepts(const textbook *t, double d2, double norm2) {
    const plr_config *c = &t->config;
    const bool likely = isfinite(d2) && (c->gate_d2 <= 0 || d2 <= c->gate_d2);
    if (c->gate_residual_px > 0)
        return norm2 <= c->gate_residual_px * c->gate_residual_px || (t->gate_open && likely);
    return likely;
}

double observe_row_gap2(const textbook *t, const plr_observation *seen) {
    const double gap = (double)seen->vL_px - (double)seen->vR_px;
    return gap * gap / (2 * t->config.pixel_sigma_px * t->config.pixel_sigma_px);
}
