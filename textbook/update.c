// SPDX-License-Identifier: MIT
/* The textbook's update: III.5 and III.10 as one, over all observations of a frame that pass the
 * gate. With S = H P H^T + R = L L^T and V = L^-1 H P the gain K is V^T L^-1, so that
 *
 *     mu <- mu + V^T (L^-1 r),    P <- P - V^T V = (I - K H) P,
 *
 * the latter by a rank-k update of the lower triangle (dsyrk). */
#include <cblas.h>
#include <lapacke.h>
#include <math.h>
#include <string.h>

#include "textbook/observe.h"
#include "textbook/se3.h"
#include "textbook/textbook.h"

enum { POSE = 6, ROWS = TEXTBOOK_ROWS, COLUMNS = OBSERVE_COLUMNS };

/* ---------------------------------------------------------------- gate */

/* Row of the state that column c of an observation's H stands for. */
static unsigned state_row(const textbook *t, unsigned landmark, unsigned c) {
    return c < POSE ? c : textbook_row(t, landmark) + c - POSE;
}

/* S = H P H^T of one observation, 4x4. */
static void predicted(const textbook *t, unsigned landmark, const observe_line *line, double *S) {
    double HP[ROWS * COLUMNS] = {0};
    memset(S, 0, ROWS * ROWS * sizeof *S);
    for (unsigned i = 0; i < ROWS; i++)
        for (unsigned a = 0; a < COLUMNS; a++)
            for (unsigned b = 0; b < COLUMNS; b++)
                HP[COLUMNS * i + b] +=
                    line->H[COLUMNS * i + a] *
                    textbook_covariance(t, state_row(t, landmark, a), state_row(t, landmark, b));
    for (unsigned i = 0; i < ROWS; i++)
        for (unsigned j = 0; j < ROWS; j++)
            for (unsigned b = 0; b < COLUMNS; b++)
                S[ROWS * i + j] += HP[COLUMNS * i + b] * line->H[COLUMNS * j + b];
}

/* r^T (S + R)^-1 r; infinite where that is not positive. */
static double distance2(const textbook *t, const double *S, const double r[ROWS]) {
    double A[ROWS * ROWS], y[ROWS], sum = 0;
    memcpy(A, S, sizeof A);
    memcpy(y, r, sizeof y);
    for (int i = 0; i < ROWS; i++)
        A[(ROWS + 1) * i] += t->config.pixel_sigma_px * t->config.pixel_sigma_px;
    if (LAPACKE_dposv(LAPACK_ROW_MAJOR, 'L', ROWS, 1, A, ROWS, y, 1) != 0)
        return (double)INFINITY;
    for (int i = 0; i < ROWS; i++)
        sum += r[i] * y[i];
    return sum;
}

/* docs/MATH.md 8. */
static bool passes(const textbook *t, unsigned landmark, const observe_line *line, double *d2) {
    const plr_config *c = &t->config;
    double S[ROWS * ROWS], norm2 = 0;
    predicted(t, landmark, line, S);
    for (int i = 0; i < ROWS; i++) {
        norm2 += line->r[i] * line->r[i];
        if (!t->landmarks[landmark].known &&
            !(S[(ROWS + 1) * i] <= t->camera.fx_px * t->camera.fx_px))
            return false;
    }
    *d2 = distance2(t, S, line->r);
    const bool likely = isfinite(*d2) && (c->gate_d2 <= 0 || *d2 <= c->gate_d2);
    if (c->gate_residual_px > 0)
        return norm2 <= c->gate_residual_px * c->gate_residual_px || (t->gate_open && likely);
    return likely;
}

/* ---------------------------------------------------------------- H P */

/* rows[r][j] = P(first + r, j), r = 0 .. count-1, j = 0 .. n-1: whichever side of the diagonal. */
static void whole_rows(const textbook *t, unsigned n, unsigned first, unsigned count,
                       double *rows) {
    for (unsigned r = 0; r < count; r++)
        memcpy(rows + r * t->ld, t->P + (first + r) * t->ld, (first + r + 1) * sizeof *rows);
    for (unsigned j = first + 1; j < n; j++) {
        const double *row = t->P + j * t->ld;
        for (unsigned r = 0; r < count && first + r < j; r++)
            rows[r * t->ld + j] = row[first + r];
    }
}

/* Four rows of H P, n long. The landmark's three rows of P are put together in `own`, 3 x ld. */
static void project(const textbook *t, unsigned n, unsigned landmark, const observe_line *line,
                    double *own, double *out) {
    const int ld = (int)t->ld;
    whole_rows(t, n, textbook_row(t, landmark), 3, own);
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, ROWS, (int)n, POSE, 1, line->H, COLUMNS,
                t->pose, ld, 0, out, ld);
    cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, ROWS, (int)n, 3, 1, line->H + POSE,
                COLUMNS, own, ld, 1, out, ld);
}

/* Rows of S = H P H^T + R that belong to one observation: (H P) times its H^T. */
static void stack_S(textbook *t, unsigned m, unsigned at, unsigned landmark,
                    const observe_line *line) {
    for (unsigned i = 0; i < m; i++)
        for (unsigned r = 0; r < ROWS; r++) {
            double sum = 0;
            for (unsigned c = 0; c < COLUMNS; c++)
                sum += t->rows[i * t->ld + state_row(t, landmark, c)] * line->H[COLUMNS * r + c];
            t->S[i * m + at + r] = sum;
        }
    for (unsigned r = 0; r < ROWS; r++)
        t->S[(at + r) * m + at + r] += t->config.pixel_sigma_px * t->config.pixel_sigma_px;
}

/* ---------------------------------------------------------------- gain */

/* T <- T Exp(d xi), b <- b + db, m <- m + dm. */
static void retract(textbook *t) {
    const double *d = t->correction;
    double D[16], moved[16];
    se3_exp(d, D);
    se3_multiply(t->T_WB, D, moved);
    memcpy(t->T_WB, moved, sizeof moved);
    se3_clean(t->T_WB);
    for (unsigned i = 0; t->config.bias && i < 6; i++)
        t->bias[i] += d[POSE + i];
    for (unsigned l = 0; l < t->count; l++)
        for (unsigned i = 0; i < 3; i++)
            t->landmarks[l].m[i] += d[textbook_row(t, l) + i];
}

static bool is_sound(const textbook *t, unsigned n) {
    for (unsigned i = 0; i < n; i++)
        if (!isfinite(t->correction[i]) || !(t->P[i * t->ld + i] >= 0))
            return false;
    return true;
}

/* m rows of H P, S and r are stacked. False if S is not positive: then nothing is changed. */
static bool apply(textbook *t, unsigned n, unsigned m) {
    const int ld = (int)t->ld, rows = (int)m;
    if (LAPACKE_dpotrf(LAPACK_ROW_MAJOR, 'L', rows, t->S, rows) != 0)
        return false;
    cblas_dtrsm(CblasRowMajor, CblasLeft, CblasLower, CblasNoTrans, CblasNonUnit, rows, (int)n, 1,
                t->S, rows, t->rows, ld);
    cblas_dtrsv(CblasRowMajor, CblasLower, CblasNoTrans, CblasNonUnit, rows, t->S, rows,
                t->innovation, 1);
    cblas_dgemv(CblasRowMajor, CblasTrans, rows, (int)n, 1, t->rows, ld, t->innovation, 1, 0,
                t->correction, 1);
    cblas_dsyrk(CblasRowMajor, CblasLower, CblasTrans, (int)n, rows, -1, t->rows, ld, 1, t->P, ld);
    if (is_sound(t, n))
        retract(t);
    else
        t->diverged = true;
    return true;
}

/* Matches and gates one observation, and stacks it if it passes. */
static void take(textbook *t, unsigned n, const plr_observation *seen, unsigned landmark,
                 unsigned *passed, textbook_report *report) {
    textbook_landmark *l = &t->landmarks[landmark];
    double *out = t->rows + (size_t)(ROWS * *passed) * t->ld, d2 = 0;
    observe_line line;
    report->matched++;
    l->times_seen++;
    l->rejected = !observe_linearise(t, landmark, seen, &line) || !passes(t, landmark, &line, &d2);
    if (l->rejected) {
        report->gated++;
        l->times_gated++;
        return;
    }
    project(t, n, landmark, &line, t->own, out);
    memcpy(t->innovation + ROWS * *passed, line.r, sizeof line.r);
    report->nis += d2;
    ++*passed;
}

textbook_report textbook_update(textbook *t, plr_time_ns t_ns, const plr_frame *frame) {
    textbook_report report = {0};
    const unsigned n = textbook_dim(t);
    unsigned passed = 0, at = 0;
    whole_rows(t, n, 0, POSE, t->pose);
    for (unsigned i = 0; i < frame->count; i++) {
        t->matched[i] = textbook_find(t, frame->observations[i].id);
        if (t->matched[i] == t->count)
            continue;
        t->landmarks[t->matched[i]].last_seen_ns = t_ns;
        take(t, n, &frame->observations[i], t->matched[i], &passed, &report);
    }
    for (unsigned i = 0; i < frame->count; i++) {
        observe_line line;
        const unsigned landmark = t->matched[i];
        if (landmark == t->count || t->landmarks[landmark].rejected)
            continue;
        (void)observe_linearise(t, landmark, &frame->observations[i], &line); /* as before */
        stack_S(t, ROWS * passed, ROWS * at++, landmark, &line);
    }
    if (passed == 0)
        return report;
    report.failed = !apply(t, n, ROWS * passed);
    report.used = report.failed || t->diverged ? 0 : passed;
    return report;
}
