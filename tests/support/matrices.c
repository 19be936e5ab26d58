// SPDX-License-Identifier: MIT
#include "support/matrices.h"

#include <math.h>
#include <string.h>

void random_spd(rng *r, unsigned n, double floor, double *A) {
    memset(A, 0, (size_t)n * n * sizeof *A);
    for (unsigned k = 0; k < n; k++) {
        double column[1024];
        rng_normals(r, 1, column, n);
        for (unsigned i = 0; i < n; i++)
            for (unsigned j = 0; j < n; j++)
                A[i * n + j] += column[i] * column[j] / n;
    }
    for (unsigned i = 0; i < n; i++)
        A[i * n + i] += floor;
}

void random_rotation(rng *r, double R[9]) {
    double q[4];
    random_direction(r, 1, q, 4);
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const double rotation[9] = {
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
        2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
    memcpy(R, rotation, sizeof rotation);
}

void random_direction(rng *r, double length, double *v, size_t n) {
    double sum = 0;
    rng_normals(r, 1, v, n);
    for (size_t i = 0; i < n; i++)
        sum += v[i] * v[i];
    for (size_t i = 0; i < n; i++)
        v[i] *= length / sqrt(sum);
}

void to_reals(plr_real *out, const double *in, size_t n) {
    for (size_t i = 0; i < n; i++)
        out[i] = (plr_real)in[i];
}

void to_doubles(double *out, const plr_real *in, size_t n) {
    for (size_t i = 0; i < n; i++)
        out[i] = (double)in[i];
}

void round_to_real(double *x, size_t n) {
    for (size_t i = 0; i < n; i++)
        x[i] = (double)(plr_real)x[i];
}

void pack_lower(plr_real *packed, const double *A, unsigned n) {
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j <= i; j++)
            *packed++ = (plr_real)A[i * n + j];
}

void unpack_symmetric(double *A, const plr_real *packed, unsigned n) {
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j <= i; j++) {
            A[i * n + j] = (double)*packed++;
            A[j * n + i] = A[i * n + j];
        }
}

/* The larger one, or NaN: fmax would hide it. */
static double larger(double most, double x) {
    return most >= x ? most : x;
}

double largest_difference(const double *a, const double *b, size_t n) {
    double most = 0;
    for (size_t i = 0; i < n && !isnan(most); i++)
        most = larger(most, fabs(a[i] - b[i]));
    return most;
}

double largest(const double *a, size_t n) {
    double most = 0;
    for (size_t i = 0; i < n && !isnan(most); i++)
        most = larger(most, fabs(a[i]));
    return most;
}

bool all_finite(const double *x, size_t n) {
    return isfinite(largest(x, n));
}

bool same_bits(const plr_real *a, const plr_real *b, size_t n) {
    return memcmp(a, b, n * sizeof *a) == 0;
}

bool is_symmetric(const plr_real *A, unsigned n) {
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j < i; j++)
            if (!same_bits(A + i * n + j, A + j * n + i, 1))
                return false;
    return true;
}
