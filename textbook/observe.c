// SPDX-License-Identifier: MIT
#include "textbook/observe.h"

#include <math.h>
#include <string.h>

#include "textbook/se3.h"

/* [I | -hat(s)], 3x6: the upper rows of III.12's circle-dot. */
static void circle_dot(const double s[3], double C[18]) {
    const double rows[18] = {1,     0, 0,    0, s[2], -s[1], 0,    1,     0,
                             -s[2], 0, s[0], 0, 0,    1,     s[1], -s[0], 0};
    memcpy(C, rows, sizeof rows);
}

/* d(uL, vL, uR, vR)/dq = K_s dpi/dq, 4x3. */
static void pixels_by_point(const plr_calibration *c, const double q[3], double D[12]) {
    const double x = q[0] / q[2], y = q[1] / q[2], base = c->baseline_m / q[2];
    const double rows[12] = {c->fx_px, 0, -c->fx_px * x,          0, c->fy_px, -c->fy_px * y,
                             c->fx_px, 0, -c->fx_px * (x - base), 0, c->fy_px, -c->fy_px * y};
    for (int i = 0; i < 12; i++)
        D[i] = rows[i] / q[2];
}

static void project(const plr_calibration *c, const double q[3], double z[TEXTBOOK_ROWS]) {
    z[0] = c->fx_px * q[0] / q[2] + c->cx_px;
    z[1] = z[3] = c->fy_px * q[1] / q[2] + c->cy_px;
    z[2] = c->fx_px * (q[0] - c->baseline_m) / q[2] + c->cx_px;
}

void observe_camera_to_world(const textbook *t, double R_WC[9]) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            R_WC[3 * i + j] = 0;
            for (int k = 0; k < 3; k++)
                R_WC[3 * i + j] += t->T_WB[4 * i + k] * t->T_CB[4 * j + k];
        }
}

void observe_world_by_pose(const textbook *t, const double s[3], double J[18]) {
    double C[18];
    circle_dot(s, C);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 6; j++) {
            J[6 * i + j] = 0;
            for (int k = 0; k < 3; k++)
                J[6 * i + j] += t->T_WB[4 * i + k] * C[6 * k + j];
        }
}

bool observe_linearise(const textbook *t, unsigned landmark, const plr_observation *seen,
                       observe_line *line) {
    const double pixels[TEXTBOOK_ROWS] = {(double)seen->uL_px, (double)seen->vL_px,
                                          (double)seen->uR_px, (double)seen->vR_px};
    double T_BW[16], s[3], q[3], z[TEXTBOOK_ROWS], D[12], C[18], R_WC[9];
    se3_inverse(t->T_WB, T_BW);
    se3_apply(T_BW, t->landmarks[landmark].m, s);
    se3_apply(t->T_CB, s, q);
    if (!(q[2] >= t->config.min_depth_m))
        return false;
    project(&t->camera, q, z);
    pixels_by_point(&t->camera, q, D);
    circle_dot(s, C);
    observe_camera_to_world(t, R_WC);
    memset(line->H, 0, sizeof line->H);
    for (int i = 0; i < TEXTBOOK_ROWS; i++) {
        double *H = line->H + OBSERVE_COLUMNS * i;
        line->r[i] = pixels[i] - z[i];
        for (int k = 0; k < 3; k++) { /* row i of D: times -R_CB C, and times R_CW */
            for (int l = 0; l < 3; l++)
                for (int j = 0; j < 6; j++)
                    H[j] -= D[3 * i + k] * t->T_CB[4 * k + l] * C[6 * l + j];
            for (int j = 0; j < 3; j++)
                H[6 + j] += D[3 * i + k] * R_WC[3 * j + k];
        }
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
