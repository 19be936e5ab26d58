// SPDX-License-Identifier: MIT
#include "posix/evaluation.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "posix/alignment.h"
#include "posix/pose_math.h"

#define DEGREES (180 / 3.14159265358979323846)

typedef struct estimate {
    plr_time_ns t_ns;
    plr_pose T_WB;
    double P_xi[21]; /* packed */
} estimate;

/* A frame with truth. */
typedef struct pair {
    const estimate *estimate;
    const plr_truth *truth;
} pair;

void evaluation_init(evaluation *e) {
    samples_init(&e->estimates, sizeof(estimate));
    samples_init(&e->truths, sizeof(plr_truth));
}

void evaluation_free(evaluation *e) {
    samples_free(&e->estimates);
    samples_free(&e->truths);
}

void evaluation_add_estimate(evaluation *e, const plr_pose_message *pose) {
    estimate added;
    memset(&added, 0, sizeof added);
    added.t_ns = pose->t_ns;
    added.T_WB = pose->T_WB;
    memcpy(added.P_xi, pose->P_xi, sizeof added.P_xi);
    samples_add(&e->estimates, &added);
}

static bool pose_is_finite(const plr_pose *pose) {
    bool finite = true;
    for (int i = 0; i < 9; i++)
        finite = finite && isfinite(pose->R[i]);
    for (int i = 0; i < 3; i++)
        finite = finite && isfinite(pose->p[i]);
    return finite;
}

void evaluation_add_truth(evaluation *e, const plr_truth *truth) {
    if (!pose_is_finite(&truth->T_WB))
        return;
    plr_truth *last = e->truths.items;
    if (e->truths.count > 0 && last[e->truths.count - 1].t_ns == truth->t_ns)
        last[e->truths.count - 1] = *truth;
    else
        samples_add(&e->truths, truth);
}

static int compare_truths(const void *a, const void *b) {
    const plr_time_ns x = ((const plr_truth *)a)->t_ns, y = ((const plr_truth *)b)->t_ns;
    return (x > y) - (x < y);
}

static int compare_time(const void *t_ns, const void *truth) {
    const plr_time_ns x = *(const plr_time_ns *)t_ns, y = ((const plr_truth *)truth)->t_ns;
    return (x > y) - (x < y);
}

/* The frames with truth, in the order in which they were estimated. */
static void find_pairs(evaluation *e, samples *pairs) {
    const estimate *estimates = e->estimates.items;
    if (e->truths.count == 0)
        return;
    qsort(e->truths.items, e->truths.count, sizeof(plr_truth), compare_truths);
    for (size_t k = 0; k < e->estimates.count; k++) {
        const pair found = {&estimates[k],
                            bsearch(&estimates[k].t_ns, e->truths.items, e->truths.count,
                                    sizeof(plr_truth), compare_time)};
        if (found.truth != NULL)
            samples_add(pairs, &found);
    }
}

static double squared_distance(const double a[3], const double b[3]) {
    double sum = 0;
    for (int i = 0; i < 3; i++)
        sum += (a[i] - b[i]) * (a[i] - b[i]);
    return sum;
}

/* e^T P^-1 e by Cholesky, P packed; NaN if P is not positive. */
static double mahalanobis(const double P[21], const double e[6]) {
    double L[21], y[6], sum = 0;
    for (int i = 0; i < 6; i++) {
        double *row = L + i * (i + 1) / 2;
        for (int j = 0; j <= i; j++) {
            const double *other = L + j * (j + 1) / 2;
            double value = P[i * (i + 1) / 2 + j];
            for (int k = 0; k < j; k++)
                value -= row[k] * other[k];
            if (i == j && !(value > 0))
                return nan("");
            row[j] = i == j ? sqrt(value) : value / other[j];
        }
        y[i] = e[i];
        for (int k = 0; k < i; k++)
            y[i] -= row[k] * y[k];
        y[i] /= row[i];
        sum += y[i] * y[i];
    }
    return sum;
}

/* err0, rotation and NEES: the truth brought to the estimate's start. */
static void compare_from_start(evaluation_figures *figures, const pair *pairs, size_t n) {
    plr_pose A, inverse, error;
    double position = 0, angle = 0, nees = 0;
    size_t counted = 0;
    pose_inverse(&inverse, &pairs[0].truth->T_WB);
    pose_compose(&A, &pairs[0].estimate->T_WB, &inverse);
    for (size_t k = 0; k < n; k++) {
        const estimate *estimated = pairs[k].estimate;
        plr_pose moved;
        double xi[6];
        pose_compose(&moved, &A, &pairs[k].truth->T_WB);
        pose_inverse(&inverse, &estimated->T_WB);
        pose_compose(&error, &inverse, &moved);
        position += squared_distance(estimated->T_WB.p, moved.p);
        angle += pow(rotation_angle(error.R), 2);
        pose_log(xi, &error);
        const bool unknown = estimated->P_xi[0] >= PLR_WIRE_UNKNOWN_VARIANCE; /* diverged */
        const double d2 = unknown ? nan("") : k > 0 ? mahalanobis(estimated->P_xi, xi) : 0;
        if (isnan(d2)) {
            figures->not_positive++;
        } else if (k > 0) {
            nees += d2 / 6;
            counted++;
        }
    }
    figures->err0_m = sqrt(position / (double)n);
    figures->rot_deg = sqrt(angle / (double)n) * DEGREES;
    figures->nees_per_dof = counted > 0 ? nees / (double)counted : nan("");
}

static double trajectory_error(const pair *pairs, size_t n) {
    double *points = malloc(6 * n * sizeof *points);
    if (points == NULL)
        return nan("");
    double *estimated = points, *true_ones = points + 3 * n, sum = 0;
    plr_pose A;
    for (size_t k = 0; k < n; k++) {
        memcpy(estimated + 3 * k, pairs[k].estimate->T_WB.p, 3 * sizeof *points);
        memcpy(true_ones + 3 * k, pairs[k].truth->T_WB.p, 3 * sizeof *points);
    }
    alignment_fit(&A, estimated, true_ones, n);
    for (size_t k = 0; k < n; k++) {
        plr_pose moved;
        pose_compose(&moved, &A, &pairs[k].truth->T_WB);
        sum += squared_distance(estimated + 3 * k, moved.p);
    }
    free(points);
    return sqrt(sum / (double)n);
}

void evaluation_start(evaluation *e, plr_pose *A) {
    static const plr_pose identity = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0}};
    samples pairs;
    samples_init(&pairs, sizeof(pair));
    find_pairs(e, &pairs);
    *A = identity;
    if (pairs.count > 0) {
        const pair *first = pairs.items;
        plr_pose inverse;
        pose_inverse(&inverse, &first->truth->T_WB);
        pose_compose(A, &first->estimate->T_WB, &inverse);
    }
    samples_free(&pairs);
}

void evaluation_figures_of(evaluation *e, evaluation_figures *figures) {
    samples pairs;
    samples_init(&pairs, sizeof(pair));
    find_pairs(e, &pairs);
    *figures = (evaluation_figures){.frames = pairs.count,
                                    .err0_m = nan(""),
                                    .ate_m = nan(""),
                                    .rot_deg = nan(""),
                                    .nees_per_dof = nan("")};
    if (pairs.count > 0) {
        compare_from_start(figures, pairs.items, pairs.count);
        figures->ate_m = trajectory_error(pairs.items, pairs.count);
    }
    samples_free(&pairs);
}
