// SPDX-License-Identifier: MIT
/* The textbook's update: III.5 and III.10 as one, over all observations of a frame that pass the
 * gate. With S = H P H^T + R = L L^T and V = L^-1 H P the gain K is V^T L^-1, so that
 *
 *     mu <- mu + V^T (L^-1 r),    P <- P - V^T V = (I - K H) P,
 *
 * the latter by a rank-k update of the lower triangle (dsyrk). Where the prior's mean is not zero
 * (`body`: the frame is linearised elsewhere), r is less what H makes of it. */
#include <math.h>
#include <string.h>

#include "support/oracle.h"
#include "support/rigid.h"
#include "textbook/body.h"
#include "textbook/consider.h"
#include "textbook/observe.h"
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
    if (!oracle_solve_spd(ROWS, 1, A, y))
        return (double)INFINITY;
    for (int i = 0; i < ROWS; i++)
        sum += r[i] * y[i];
    return sum;
}

/* docs/MATH.md 8; where the search for the motion has judged already, its verdict. */
static bool passes(const textbook *t, unsigned landmark, const observe_line *line, bool judged,
                   double *d2) {
    const textbook_landmark *l = &t->landmarks[landmark];
    double S[ROWS * ROWS], norm2 = 0;
    if (judged) {
        *d2 = l->d2;
        return isfinite(l->d2) && observe_accepts(t, l->d2, l->norm2);
    }
    predicted(t, landmark, line, S);
    for (int i = 0; i < ROWS; i++) {
        norm2 += line->r[i] * line->r[i];
        if (!l->known && !(S[(ROWS + 1) * i] <= t->camera.fx_px * t->camera.fx_px))
            return false;
    }
    *d2 = distance2(t, S, line->r);
    return observe_accepts(t, *d2, norm2);
}

/* ---------------------------------------------------------------- H P */

/* rows[r][j] = P(first + r, j), r = 0 .. count-1, j = 0 .. n-1: whichever side of the diagonal. */
static void whole_rows(const textbook *t, unsigned n, unsigned first, unsigned count,
                       double *rows) {
    for (unsigned r = 0; r < count; r++)
        memcpy(rows + r * (size_t)n, t->P + (first + r) * t->ld, (first + r + 1) * sizeof *rows);
    for (unsigned j = first + 1; j < n; j++) {
        const double *row = t->P + j * t->ld;
        for (unsigned r = 0; r < count && first + r < j; r++)
            rows[r * (size_t)n + j] = row[first + r];
    }
}

/* Four rows of H P, n long. The landmark's three rows of P are put together in `own`. */
static void project(const textbook *t, unsigned n, unsigned landmark, const observe_line *line,
                    double *out) {
    memset(out, 0, ROWS * (size_t)n * sizeof *out);
    whole_rows(t, n, textbook_row(t, landmark), 3, t->own);
    for (unsigned r = 0; r < ROWS; r++)
        for (unsigned c = textbook_is_body(t) ? POSE : 0; c < COLUMNS; c++) {
            const double h = line->H[COLUMNS * r + c];
            const double *row =
                c < POSE ? t->pose + c * (size_t)n : t->own + (c - POSE) * (size_t)n;
            for (unsigned j = 0; j < n; j++)
                out[r * (size_t)n + j] += h * row[j];
        }
}

/* Rows of S = H P H^T + R that belong to one observation: (H P) times its H^T. */
static void stack_S(textbook *t, unsigned n, unsigned m, unsigned at, unsigned landmark,
                    const observe_line *line) {
    for (unsigned i = 0; i < m; i++)
        for (unsigned r = 0; r < ROWS; r++) {
            double sum = 0;
            for (unsigned c = 0; c < COLUMNS; c++)
                sum +=
                    t->rows[i * (size_t)n + state_row(t, landmark, c)] * line->H[COLUMNS * r + c];
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
    if (textbook_is_body(t))
        body_retract(t);
    else
        for (unsigned l = 0; l < t->count; l++)
            for (unsigned i = 0; i < 3; i++)
                t->landmarks[l].x[i] += d[textbook_row(t, l) + i];
    rigid_exp(D, d);
    square_multiply(4, t->T_WB, D, moved);
    memcpy(t->T_WB, moved, sizeof moved);
    rigid_clean(t->T_WB);
    for (unsigned i = 0; t->config.bias && i < 6; i++)
        t->bias[i] += d[POSE + i];
}

static bool is_sound(const textbook *t, unsigned n) {
    for (unsigned i = 0; i < n; i++)
        if (!isfinite(t->correction[i]) || !(t->P[i * t->ld + i] >= 0))
            return false;
    return true;
}

/* The innovation's d2 and ln det S, S = L L^T factorised and y = L^-1 r. vL - vR is no function of
 * the state, and of the variance 2 sigma^2: mean and difference have a Jacobian of one. */
static void weigh(const textbook *t, unsigned m, textbook_report *report) {
    const double difference = 2 * t->config.pixel_sigma_px * t->config.pixel_sigma_px;
    for (unsigned i = 0; i < m; i++) {
        report->d2 += t->innovation[i] * t->innovation[i];
        report->log_det += 2 * log(t->S[i * (size_t)m + i]);
    }
    report->log_det -= m / ROWS * log(difference);
}

/* m rows of H P, S and r are stacked. False if S is not positive: then nothing is changed. */
static bool gain(textbook *t, unsigned n, unsigned m, textbook_report *report) {
    if (!oracle_cholesky(m, t->S))
        return false;
    oracle_solve_lower(m, n, t->S, t->rows);
    oracle_solve_lower(m, 1, t->S, t->innovation);
    weigh(t, m, report);
    oracle_gemm(ORACLE_TRANSPOSED, ORACLE_PLAIN, n, 1, m, 1, t->rows, t->innovation, 1,
                t->correction);
    if (t->considered)
        consider_biases(t, n, m, t->considered);
    else
        oracle_downdate(n, m, t->rows, t->P, t->ld);
    t->diverged = !is_sound(t, n);
    return true;
}

/* r - H mean: the mean is that of the pose's and the landmark's errors before the frame. */
static void subtract_prior(const textbook *t, unsigned landmark, observe_line *line) {
    double beyond[3];
    body_beyond(&t->landmarks[landmark], beyond);
    for (unsigned r = 0; r < ROWS; r++)
        for (unsigned c = 0; c < COLUMNS; c++)
            line->r[r] -= line->H[COLUMNS * r + c] * (t->correction[state_row(t, landmark, c)] +
                                                      (c < POSE ? 0 : beyond[c - POSE]));
}

/* Matches and gates one observation, and stacks it if it passes. */
static void take(textbook *t, unsigned n, const plr_observation *seen, unsigned landmark,
                 bool judged, unsigned *passed, textbook_report *report) {
    textbook_landmark *l = &t->landmarks[landmark];
    double *out = t->rows + ROWS * *passed * (size_t)n, d2 = 0;
    observe_line line;
    report->matched++;
    l->times_seen++;
    l->rejected = true;
    if (!t->pending && observe_linearise(t, landmark, seen, &line)) {
        if (textbook_is_body(t))
            subtract_prior(t, landmark, &line);
        l->rejected = !passes(t, landmark, &line, judged, &d2);
    }
    if (l->rejected) {
        report->gated++;
        l->times_gated++;
        return;
    }
    project(t, n, landmark, &line, out);
    memcpy(t->innovation + ROWS * *passed, line.r, sizeof line.r);
    const double gap = (line.r[1] - line.r[3]) / t->config.pixel_sigma_px;
    report->d2 -= 0.5 * gap * gap; /* weigh() adds it */
    report->nis += d2;
    ++*passed;
}

/* The biases' walk since it was last added: without the correlation that arises meanwhile. */
static void walk(textbook *t) {
    for (unsigned i = POSE; i < textbook_row(t, 0); i++)
        t->P[i * (t->ld + 1)] +=
            t->walked_s * (i < POSE + 3 ? t->config.bias_velocity_walk : t->config.bias_gyro_walk);
    t->walked_s = 0;
}

/* Matches, gates and stacks a frame's observations; returns how many have passed. */
static unsigned stack_frame(textbook *t, unsigned n, plr_time_ns t_ns, const plr_frame *frame,
                            bool judged, textbook_report *report) {
    unsigned passed = 0, at = 0;
    for (unsigned i = 0; i < frame->count; i++) {
        t->matched[i] = textbook_find(t, frame->observations[i].id);
        if (t->matched[i] == t->count)
            continue;
        t->landmarks[t->matched[i]].last_seen_ns = t_ns;
        take(t, n, &frame->observations[i], t->matched[i], judged, &passed, report);
    }
    for (unsigned i = 0; i < frame->count; i++) {
        observe_line line;
        const unsigned landmark = t->matched[i];
        if (landmark == t->count || t->landmarks[landmark].rejected)
            continue;
        (void)observe_linearise(t, landmark, &frame->observations[i], &line); /* as before */
        for (unsigned r = 0; t->considered && r < ROWS; r++)
            consider_row(t, line.H + COLUMNS * r, line.H + COLUMNS * r + POSE, landmark,
                         t->considered + (ROWS * at + r) * (size_t)n);
        stack_S(t, n, ROWS * passed, ROWS * at++, landmark, &line);
    }
    return passed;
}

textbook_report textbook_update(textbook *t, plr_time_ns t_ns, const plr_frame *frame) {
    textbook_report report = {0};
    const unsigned n = textbook_dim(t);
    bool judged = false;
    memset(t->correction, 0, n * sizeof *t->correction);
    if (textbook_is_body(t))
        judged = body_catch_up(t, frame);
    if (!t->pending)
        walk(t);
    whole_rows(t, n, 0, POSE, t->pose);
    const unsigned passed = stack_frame(t, n, t_ns, frame, judged, &report);
    report.failed = passed > 0 && !gain(t, n, ROWS * passed, &report);
    report.used = report.failed || t->diverged ? 0 : passed;
    if (!t->pending && !t->diverged)
        retract(t);
    return report;
}
