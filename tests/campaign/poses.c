// SPDX-License-Identifier: MIT
#include "campaign/poses.h"

#include <math.h>
#include <string.h>

static void cross(const double a[3], const double b[3], double c[3]) {
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* y = R x, by Rodrigues' formula, and z = V x, its integral over the turn. */
static void turn(const double theta[3], const double x[3], double y[3], double z[3]) {
    const double angle2 = dot(theta, theta), angle = sqrt(angle2);
    double a, b, c; /* sin t / t, (1 - cos t) / t^2, (t - sin t) / t^3 */
    if (angle < 1e-4) {
        a = 1 - angle2 / 6;
        b = 0.5 - angle2 / 24;
        c = 1.0 / 6 - angle2 / 120;
    } else {
        a = sin(angle) / angle;
        b = (1 - cos(angle)) / angle2;
        c = (1 - a) / angle2;
    }
    double once[3], twice[3];
    cross(theta, x, once);
    cross(theta, once, twice);
    for (int i = 0; i < 3; i++) {
        y[i] = x[i] + a * once[i] + b * twice[i];
        z[i] = x[i] + b * once[i] + c * twice[i];
    }
}

/* Gram and Schmidt on the rows: a million steps leave a rotation a rotation. */
static void straighten(double R[9]) {
    const double n0 = 1 / sqrt(dot(R, R));
    for (int i = 0; i < 3; i++)
        R[i] *= n0;
    const double d = dot(R, R + 3);
    for (int i = 0; i < 3; i++)
        R[3 + i] -= d * R[i];
    const double n1 = 1 / sqrt(dot(R + 3, R + 3));
    for (int i = 0; i < 3; i++)
        R[3 + i] *= n1;
    cross(R, R + 3, R + 6);
}

plr_pose pose_moved(const plr_pose *T, const double xi[6]) {
    plr_pose moved;
    double column[3], unused[3], step[3];
    for (int j = 0; j < 3; j++) {
        const double e[3] = {j == 0, j == 1, j == 2};
        turn(xi + 3, e, column, unused);
        for (int i = 0; i < 3; i++)
            moved.R[3 * i + j] = dot(T->R + 3 * i, column);
    }
    turn(xi + 3, xi, unused, step);
    pose_outwards(T, step, moved.p);
    straighten(moved.R);
    return moved;
}

void pose_outwards(const plr_pose *T, const double x[3], double out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] = dot(T->R + 3 * i, x) + T->p[i];
}

void pose_inwards(const plr_pose *T, const double x[3], double in[3]) {
    const double d[3] = {x[0] - T->p[0], x[1] - T->p[1], x[2] - T->p[2]};
    for (int i = 0; i < 3; i++)
        in[i] = T->R[i] * d[0] + T->R[3 + i] * d[1] + T->R[6 + i] * d[2];
}

/* theta of R = Exp(theta), any angle but half a turn to the last digits. */
static void rotation_log(const double R[9], double theta[3]) {
    const double axis[3] = {R[7] - R[5], R[2] - R[6], R[3] - R[1]};
    const double sine = 0.5 * sqrt(dot(axis, axis));
    const double cosine = 0.5 * (R[0] + R[4] + R[8] - 1);
    const double angle = atan2(sine, cosine);
    const double factor = sine > 1e-9 ? 0.5 * angle / sine : 0.5;
    for (int i = 0; i < 3; i++)
        theta[i] = factor * axis[i];
}

/* rho = V^-1 t = t - theta x t / 2 + e theta x (theta x t) */
static void undo_integral(const double theta[3], const double t[3], double rho[3]) {
    const double angle2 = dot(theta, theta), angle = sqrt(angle2);
    double once[3], twice[3], e = 1.0 / 12;
    if (angle > 1e-4)
        e = (1 - 0.5 * angle * cos(0.5 * angle) / sin(0.5 * angle)) / angle2;
    cross(theta, t, once);
    cross(theta, once, twice);
    for (int i = 0; i < 3; i++)
        rho[i] = t[i] - 0.5 * once[i] + e * twice[i];
}

void pose_error(const plr_pose *estimate, const plr_pose *T, double xi[6]) {
    double R[9], t[3];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            R[3 * i + j] = estimate->R[i] * T->R[j] + estimate->R[3 + i] * T->R[3 + j] +
                           estimate->R[6 + i] * T->R[6 + j];
    pose_inwards(estimate, T->p, t);
    rotation_log(R, xi + 3);
    undo_integral(xi + 3, t, xi);
}

double pose_nees(const double xi[6], const double P[36]) {
    double L[6][6], y[6], sum = 0;
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j <= i; j++) {
            double s = P[6 * i + j];
            for (int k = 0; k < j; k++)
                s -= L[i][k] * L[j][k];
            if (i == j && !(s > 0))
                return -1;
            L[i][j] = i == j ? sqrt(s) : s / L[j][j];
        }
        y[i] = xi[i];
        for (int k = 0; k < i; k++)
            y[i] -= L[i][k] * y[k];
        y[i] /= L[i][i];
        sum += y[i] * y[i];
    }
    return sum;
}
