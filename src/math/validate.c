// SPDX-License-Identifier: MIT
#include "math/validate.h"

#include "math/finite.h"

bool plr_is_rotation(const double R[9]) {
    const double tolerance = 1e-3;
    if (!plr_all_finite(R, 9))
        return false;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            double dot = i == j ? -1 : 0;
            for (int k = 0; k < 3; k++)
                dot += R[3 * i + k] * R[3 * j + k];
            if (!(dot < tolerance && dot > -tolerance))
                return false;
        }
    const double determinant = R[0] * (R[4] * R[8] - R[5] * R[7]) -
                               R[1] * (R[3] * R[8] - R[5] * R[6]) +
                               R[2] * (R[3] * R[7] - R[4] * R[6]);
    return determinant > 0;
}

/* By elimination: every pivot of a positive semidefinite matrix is >= 0, but for rounding. */
bool plr_is_covariance(const double *P, unsigned n) {
    enum { MAX = PLR_POSE_DIM };
    double A[MAX * MAX];
    if (n > MAX || !plr_all_finite(P, n * n))
        return false;
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j < n; j++) {
            const double gap = P[n * i + j] - P[n * j + i];
            const double scale = P[n * i + i] + P[n * j + j];
            if (!(P[n * i + i] >= 0) || gap > 1e-6 * scale || -gap > 1e-6 * scale)
                return false;
            A[n * i + j] = P[n * i + j];
        }
    for (unsigned k = 0; k < n; k++) {
        const double pivot = A[n * k + k], floor = 1e-9 * P[n * k + k];
        if (pivot < -floor)
            return false;
        for (unsigned i = k + 1; i < n; i++) {
            const double column = A[n * i + k];
            if (pivot <= floor) {
                /* a direction without variance may not be correlated with anything */
                const double limit = 1e-6 * (P[n * i + i] + P[n * k + k]);
                if (column > limit || column < -limit)
                    return false;
                continue;
            }
            for (unsigned j = k + 1; j < n; j++)
                A[n * i + j] -= column * A[n * k + j] / pivot;
        }
    }
    return true;
}

bool plr_is_place(const double p[3], const double P[9]) {
    return plr_all_within(p, 3, PLR_MAX_POSITION) && plr_all_within(P, 9, PLR_MAX_VARIANCE) &&
           plr_is_covariance(P, 3);
}
