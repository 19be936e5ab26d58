// SPDX-License-Identifier: MIT
#include "posix/pose_math.h"

#include <math.h>

void pose_compose(plr_pose *C, const plr_pose *A, const plr_pose *B) {
    plr_pose product;
    for (int i = 0; i < 3; i++) {
        product.p[i] = A->p[i];
        for (int j = 0; j < 3; j++) {
            product.p[i] += A->R[3 * i + j] * B->p[j];
            product.R[3 * i + j] = 0;
            for (int k = 0; k < 3; k++)
                product.R[3 * i + j] += A->R[3 * i + k] * B->R[3 * k + j];
        }
    }
    *C = product;
}

void pose_inverse(plr_pose *inverse, const plr_pose *A) {
    for (int i = 0; i < 3; i++) {
        inverse->p[i] = 0;
        for (int j = 0; j < 3; j++) {
            inverse->R[3 * i + j] = A->R[3 * j + i];
            inverse->p[i] -= A->R[3 * j + i] * A->p[j];
        }
    }
}

/* sin(angle) times the axis. */
static void skew_part(double s[3], const double R[9]) {
    s[0] = 0.5 * (R[7] - R[5]);
    s[1] = 0.5 * (R[2] - R[6]);
    s[2] = 0.5 * (R[3] - R[1]);
}

static double norm3(const double x[3]) {
    return sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
}

double rotation_angle(const double R[9]) {
    double s[3];
    skew_part(s, R);
    return atan2(norm3(s), 0.5 * (R[0] + R[4] + R[8] - 1));
}

/* The four squared components of the quaternion times four; the largest is taken as the pivot, so
 * that nothing is divided by a small number (Shepperd 1978). */
void rotation_quaternion(double q[4], const double R[9]) {
    const double trace = R[0] + R[4] + R[8];
    const double squares[4] = {1 + 2 * R[0] - trace, 1 + 2 * R[4] - trace, 1 + 2 * R[8] - trace,
                               1 + trace};
    int pivot = 0;
    for (int i = 1; i < 4; i++)
        if (squares[i] > squares[pivot])
            pivot = i;
    const double xy = R[1] + R[3], xz = R[2] + R[6], yz = R[5] + R[7];
    const double wx = R[7] - R[5], wy = R[2] - R[6], wz = R[3] - R[1];
    const double rows[4][4] = {{squares[0], xy, xz, wx},
                               {xy, squares[1], yz, wy},
                               {xz, yz, squares[2], wz},
                               {wx, wy, wz, squares[3]}};
    double norm = 0;
    for (int i = 0; i < 4; i++)
        norm += rows[pivot][i] * rows[pivot][i];
    const double scale = (rows[pivot][3] < 0 ? -1 : 1) / sqrt(norm);
    for (int i = 0; i < 4; i++)
        q[i] = rows[pivot][i] * scale;
}

void rotation_from_quaternion(double R[9], const double q[4]) {
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    const double rotation[9] = {
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
        2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y),
    };
    for (int i = 0; i < 9; i++)
        R[i] = rotation[i];
}

/* The rotation vector, by way of the quaternion: good up to pi. */
static void rotation_vector(double theta[3], const double R[9]) {
    double q[4];
    rotation_quaternion(q, R);
    const double sine = norm3(q); /* of half the angle */
    const double scale = sine > 1e-12 ? 2 * atan2(sine, q[3]) / sine : 2;
    for (int i = 0; i < 3; i++)
        theta[i] = q[i] * scale;
}

static void cross(double c[3], const double a[3], const double b[3]) {
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

/* V^-1 = I - [theta]x / 2 + (1/a^2 - (1 + cos a) / (2 a sin a)) [theta]x^2, a = |theta|. */
void pose_log(double xi[6], const plr_pose *A) {
    double *theta = xi + 3, once[3], twice[3];
    rotation_vector(theta, A->R);
    const double a = norm3(theta);
    double c = 1.0 / 12 + a * a / 720;
    if (a > 1e-3)
        c = (1 - 0.5 * a / tan(0.5 * a)) / (a * a);
    cross(once, theta, A->p);
    cross(twice, theta, once);
    for (int i = 0; i < 3; i++)
        xi[i] = A->p[i] - 0.5 * once[i] + c * twice[i];
}
