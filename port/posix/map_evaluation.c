// SPDX-License-Identifier: MIT
#include "posix/map_evaluation.h"

#include <math.h>
#include <stdlib.h>

static int compare_id(const void *id, const void *landmark) {
    const uint32_t x = *(const uint32_t *)id, y = ((const plr_landmark *)landmark)->id;
    return (x > y) - (x < y);
}

/* e^T P^-1 e by Cholesky, 3x3; NaN if P is not positive. */
static double mahalanobis(const double P[9], const double e[3]) {
    double L[9] = {0}, y[3], sum = 0;
    for (int i = 0; i < 3; i++) {
        y[i] = e[i];
        for (int j = 0; j <= i; j++) {
            double value = P[3 * i + j];
            for (int k = 0; k < j; k++)
                value -= L[3 * i + k] * L[3 * j + k];
            if (i == j && !(value > 0))
                return nan("");
            L[3 * i + j] = i == j ? sqrt(value) : value / L[4 * j];
        }
        for (int k = 0; k < i; k++)
            y[i] -= L[3 * i + k] * y[k];
        y[i] /= L[4 * i];
        sum += y[i] * y[i];
    }
    return sum;
}

/* e = m^ - A m */
static void error_of(double e[3], const plr_landmark *made, const plr_landmark *known,
                     const plr_pose *A) {
    for (int i = 0; i < 3; i++) {
        e[i] = made->p_W_m[i] - A->p[i];
        for (int j = 0; j < 3; j++)
            e[i] -= A->R[3 * i + j] * known->p_W_m[j];
    }
}

static void add(map_figures *figures, samples *distances, const plr_landmark *made,
                const double e[3]) {
    const double *P = made->P_W_m2, squared = e[0] * e[0] + e[1] * e[1] + e[2] * e[2];
    const double distance = sqrt(squared), sigma = sqrt((P[0] + P[4] + P[8]) / 3);
    figures->landmarks++;
    figures->rms_m += squared;
    const double d2 = mahalanobis(P, e);
    if (isnan(d2))
        figures->not_positive++;
    else
        figures->nees_per_dof += d2 / 3;
    figures->least_sigma_m = fmin(figures->least_sigma_m, sigma);
    figures->largest_sigma_m = fmax(figures->largest_sigma_m, sigma);
    samples_add(distances, &distance);
}

/* Of a sorted list: the middle one, or the mean of the two in the middle. */
static double median_of(const samples *sorted) {
    const double *items = sorted->items;
    const size_t n = sorted->count;
    return n > 0 ? (items[(n - 1) / 2] + items[n / 2]) / 2 : nan("");
}

void map_figures_of(map_figures *figures, const samples *made, const plr_known_map *known,
                    const plr_pose *A) {
    const plr_landmark_message *items = made->items;
    samples distances;
    samples_init(&distances, sizeof(double));
    *figures = (map_figures){.least_sigma_m = (double)INFINITY};
    for (size_t i = 0; i < made->count && known->count > 0; i++) {
        const plr_landmark *landmark = &items[i].landmark;
        const plr_landmark *truth =
            bsearch(&landmark->id, known->landmarks, known->count, sizeof *truth, compare_id);
        double e[3];
        if (truth == NULL || landmark->known)
            continue;
        error_of(e, landmark, truth, A);
        add(figures, &distances, landmark, e);
    }
    samples_sort_doubles(&distances);
    const double n = (double)figures->landmarks;
    const bool any = figures->landmarks > 0;
    figures->rms_m = any ? sqrt(figures->rms_m / n) : nan("");
    figures->median_m = median_of(&distances);
    figures->nees_per_dof = figures->landmarks > figures->not_positive
                                ? figures->nees_per_dof / (n - (double)figures->not_positive)
                                : nan("");
    if (!any)
        figures->least_sigma_m = figures->largest_sigma_m = nan("");
    samples_free(&distances);
}
