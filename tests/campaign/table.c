// SPDX-License-Identifier: MIT
#include "campaign/table.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A mean over seeds, and its standard error. */
typedef struct mean {
    double sum, squares;
    unsigned n;
} mean;

static void mean_add(mean *m, double x) {
    m->sum += x;
    m->squares += x * x;
    m->n++;
}

static double mean_of(const mean *m) {
    return m->n ? m->sum / m->n : (double)NAN;
}

static double error_of(const mean *m) {
    if (m->n < 2)
        return 0;
    const double variance = (m->squares - m->sum * m->sum / m->n) / (m->n - 1);
    return sqrt(fmax(variance, 0) / m->n);
}

/* How a scenario did, over all seeds. */
typedef struct tally {
    unsigned seeds, died, diverged_seeds;
    account phase[PHASES]; /* counts summed, worst of sigmas */
    mean nees[PHASES], end_m[PHASES], end_rad[PHASES], own_m[PHASES], own_rad[PHASES];
    mean bias[6];
    double matched, gated, refused, resets;
    double reasons[PHASES][REASONS];
    double *told, *again; /* sorted; those never told or good again at the end, as infinity */
    double first_diverged, later_sigmas;
    mean later_error2, later_own2, fresh_own2; /* m^2 */
    mean reckoned_m, reckoned_unbiased_m;
} tally;

static void add_phase(tally *t, phase p, const account *a) {
    account *sum = &t->phase[p];
    if (a->frames == 0)
        return;
    sum->frames += a->frames;
    sum->good += a->good;
    sum->beyond += a->beyond;
    sum->silent += a->silent;
    sum->diverged += a->diverged;
    sum->sigmas = fmax(sum->sigmas, a->sigmas);
    sum->mahalanobis = fmax(sum->mahalanobis, a->mahalanobis);
    if (a->judged)
        mean_add(&t->nees[p], a->nees / (6.0 * a->judged));
    mean_add(&t->end_m[p], a->error_m);
    mean_add(&t->end_rad[p], a->error_rad);
    mean_add(&t->own_m[p], a->sigma_m);
    mean_add(&t->own_rad[p], a->sigma_rad);
}

static void add(tally *t, const outcome *o) {
    if (!o->done) {
        t->died++;
        return;
    }
    for (int p = 0; p < PHASES; p++)
        add_phase(t, (phase)p, &o->phase[p]);
    for (int i = 0; i < 6 && o->has_bias; i++)
        mean_add(&t->bias[i], o->bias_sigmas[i]);
    for (int p = 0; p < PHASES; p++)
        for (int i = 0; i < REASONS; i++)
            t->reasons[p][i] += o->reasons[p][i];
    t->matched += o->matched;
    t->gated += o->gated;
    t->refused += o->refused;
    t->resets += o->resets;
    t->told[t->seeds] = o->told_frames < 0 ? HUGE_VAL : o->told_frames;
    t->again[t->seeds] = o->again_s < 0 ? HUGE_VAL : o->again_s;
    t->later_sigmas = fmax(t->later_sigmas, o->later_sigmas);
    mean_add(&t->later_error2, o->later_error_m * o->later_error_m);
    mean_add(&t->later_own2, o->later_own_m * o->later_own_m);
    mean_add(&t->fresh_own2, o->fresh_own_m * o->fresh_own_m);
    mean_add(&t->reckoned_m, o->reckoned_m);
    mean_add(&t->reckoned_unbiased_m, o->reckoned_unbiased_m);
    if (o->first_diverged >= 0) {
        t->diverged_seeds++;
        if (!(t->first_diverged <= o->first_diverged))
            t->first_diverged = o->first_diverged;
    }
    t->seeds++;
}

static int compare(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double quantile(const double *sorted, unsigned n, double share) {
    if (n == 0)
        return (double)NAN;
    const unsigned i = (unsigned)ceil(share * n);
    return sorted[i > 0 ? i - 1 : 0];
}

static double share(double part, double whole) {
    return whole > 0 ? part / whole : 0;
}

/* ---------------------------------------------------------------- the limits */

typedef struct verdict {
    bool pass;
    char text[400];
} verdict;

static void hold(verdict *v, bool holds, const char *what, double is, double limit) {
    const size_t used = strlen(v->text);
    v->pass &= holds;
    (void)snprintf(v->text + used, sizeof v->text - used, "%s%s %.4g (%.4g)%s", used ? ", " : "",
                   what, is, limit, holds ? "" : " FAIL");
}

static void most(verdict *v, const char *what, double is, double limit) {
    if (limit > 0)
        hold(v, is <= limit, what, is, limit);
}

/* How wide the filter's sigma is one second after an event, beside what it ought to cover: the
 * errors that there are, and what no filter knows better one second after a start. */
static double width(const tally *t) {
    return sqrt(mean_of(&t->later_own2) / (mean_of(&t->later_error2) + mean_of(&t->fresh_own2)));
}

static double least_nees(const tally *t, unsigned p) {
    return mean_of(&t->nees[p]) - 2 * error_of(&t->nees[p]);
}

static verdict judge(const scenario *s, const tally *t) {
    const bars *b = &s->bars;
    const account *before = &t->phase[BEFORE], *during = &t->phase[DURING];
    const account *after = &t->phase[AFTER];
    verdict v = {true, ""};
    most(&v, "NEES/6 - 2 se", least_nees(t, BEFORE), b->nees);
    if (during->frames)
        most(&v, "NEES/6 during", least_nees(t, DURING), b->event_nees);
    if (after->frames)
        most(&v, "NEES/6 after", least_nees(t, AFTER), b->event_nees);
    most(&v, "sigmas", before->sigmas, b->sigmas);
    most(&v, "|forward bias| - 2 se", fabs(mean_of(&t->bias[0])) - 2 * error_of(&t->bias[0]),
         b->forward_bias);
    const double good = share(before->good, before->frames);
    if (b->good > 0)
        hold(&v, good >= b->good, "nominal GOOD", good, b->good);
    most(&v, "silent during", share(during->silent, during->frames), b->silent);
    if (after->frames)
        most(&v, "after", share(after->silent, after->frames), b->silent);
    most(&v, "told", quantile(t->told, t->seeds, 0.95), b->told_frames);
    most(&v, "error m", mean_of(&t->end_m[DURING]), b->error_m);
    if (s->mishap == CONVOY) /* the pose is to be no worse than without a camera */
        most(&v, "error m beside dead reckoning's", mean_of(&t->end_m[DURING]),
             mean_of(&t->reckoned_m));
    most(&v, "again s", quantile(t->again, t->seeds, 0.95), b->again_s);
    most(&v, "later sigmas", t->later_sigmas, b->later_sigmas);
    most(&v, "width", width(t), b->later_width);
    if (b->no_divergence && t->diverged_seeds)
        hold(&v, false, "diverged", t->diverged_seeds, 0);
    if (t->died)
        hold(&v, false, "died", t->died, 0);
    return v;
}

/* ---------------------------------------------------------------- printing */

/* The names of plr_reason, short. */
static const char *reason_name(unsigned bit) {
    static const char *const names[] = {
        "few",          "none-used",    "gate-locked", "gate-inert", "block-failed", "sink",
        "no-room",      "refused",      "nis-high",    "range",      "not-positive", "budget",
        "contradicted", "may-be-wrong", "bias-off",    "nis-low",    "frozen",       "?",
        "recovered",    "no-frames",    "damaged",     "no-twists",  "readings",     "not-started",
        "imu-fault",    "relocated",    "map",         "misfit"};
    return bit < sizeof names / sizeof names[0] ? names[bit] : "?";
}

void table_heading(void) {
    static const char *const phases[] = {
        "phases: nominal (or before an event), event, after.",
        "NEES/6: mean over frames and seeds, with the standard error over seeds.",
        "max: largest component of any error in its own sigmas; d: largest Mahalanobis distance.",
        "silent: share of frames GOOD while a component is beyond 5 sigma.",
        "err, own: error and the filter's sigma at the end of the phase, means over seeds.",
        "limits stand in brackets behind what they limit."};
    for (unsigned i = 0; i < sizeof phases / sizeof phases[0]; i++)
        printf("# %s\n", phases[i]);
    printf("\n%-18s %-8s %14s %8s %8s %7s %7s %7s %9s %9s %9s %9s\n", "scenario", "phase", "NEES/6",
           "max", "d", "GOOD", "beyond", "silent", "err m", "own m", "err rad", "own rad");
}

static void print_phase(const char *name, const char *label, const tally *t, phase p) {
    const account *a = &t->phase[p];
    if (a->frames == 0)
        return;
    printf("%-18s %-8s %8.3f+-%-5.3f%7.4g %8.4g %7.4f %7.4f %7.4f %9.4g %9.4g %9.4g %9.4g", name,
           label, mean_of(&t->nees[p]), error_of(&t->nees[p]), a->sigmas, a->mahalanobis,
           share(a->good, a->frames), share(a->beyond, a->frames), share(a->silent, a->frames),
           mean_of(&t->end_m[p]), mean_of(&t->own_m[p]), mean_of(&t->end_rad[p]),
           mean_of(&t->own_rad[p]));
    if (a->diverged)
        printf("  diverged in %u frames", a->diverged);
    printf("\n");
}

/* What kept the filter from being GOOD: shares of the phase's frames. */
static void print_reasons(const tally *t, phase p) {
    static const char *const names[PHASES] = {"before", "event", "after"};
    bool any = false;
    for (unsigned i = 0; i < REASONS; i++)
        if (t->reasons[p][i] > 0) {
            if (!any)
                printf("  not GOOD %s:", names[p]);
            printf("%s %s %.4f", any ? "," : "", reason_name(i),
                   share(t->reasons[p][i], t->phase[p].frames));
            any = true;
        }
    if (any)
        printf("\n");
}

static void print_details(const scenario *s, const tally *t) {
    printf("  %u seeds, gated %.4f", t->seeds, share(t->gated, t->matched));
    if (t->bias[0].n)
        printf(", bias in sigmas: forward %+.2f+-%.2f left %+.2f up %+.2f yaw %+.2f+-%.2f",
               mean_of(&t->bias[0]), error_of(&t->bias[0]), mean_of(&t->bias[1]),
               mean_of(&t->bias[2]), mean_of(&t->bias[5]), error_of(&t->bias[5]));
    if (t->diverged_seeds)
        printf(", %u seeds diverged, the first at frame %.0f", t->diverged_seeds,
               t->first_diverged);
    if (s->during)
        printf(", told after %g (95 %%: %g) frames", quantile(t->told, t->seeds, 0.5),
               quantile(t->told, t->seeds, 0.95));
    if (s->after)
        printf(", GOOD again after %g (95 %%: %g) s\n"
               "  one second later: within %.3g sigma, error %.3g m, own %.3g m, a fresh start's "
               "%.3g m, width %.3g",
               quantile(t->again, t->seeds, 0.5), quantile(t->again, t->seeds, 0.95),
               t->later_sigmas, sqrt(mean_of(&t->later_error2)), sqrt(mean_of(&t->later_own2)),
               sqrt(mean_of(&t->fresh_own2)), width(t));
    if (s->during)
        printf(", dead reckoning %.3g m at the event's end, %.3g m less the biases",
               mean_of(&t->reckoned_m), mean_of(&t->reckoned_unbiased_m));
    if (t->refused > 0)
        printf(", %.0f readings refused", t->refused);
    if (t->resets > 0)
        printf(", %.1f resets a drive", t->resets / t->seeds);
    printf("\n");
}

static void add_all(tally *t, const outcome *outcomes, unsigned seeds) {
    memset(t, 0, sizeof *t);
    t->first_diverged = (double)NAN;
    t->told = calloc(seeds, sizeof *t->told);
    t->again = calloc(seeds, sizeof *t->again);
    if (!t->told || !t->again) {
        fprintf(stderr, "campaign: no memory for %u seeds\n", seeds);
        exit(2);
    }
    for (unsigned i = 0; i < seeds; i++)
        add(t, &outcomes[i]);
    qsort(t->told, t->seeds, sizeof *t->told, compare);
    qsort(t->again, t->seeds, sizeof *t->again, compare);
}

static void release(tally *t) {
    fflush(stdout);
    free(t->told);
    free(t->again);
}

bool table_print(const scenario *s, const outcome *outcomes, unsigned seeds) {
    tally t;
    add_all(&t, outcomes, seeds);
    print_phase(s->name, s->during ? "before" : "nominal", &t, BEFORE);
    print_phase(t.phase[BEFORE].frames ? "" : s->name, "event", &t, DURING);
    print_phase("", "after", &t, AFTER);
    print_details(s, &t);
    for (int p = 0; p < PHASES; p++)
        print_reasons(&t, (phase)p);
    const verdict v = judge(s, &t);
    printf("  %s: %s\n", v.pass ? "pass" : "FAIL", v.text);
    release(&t);
    return v.pass;
}

void table_print_other(const scenario *s, uint8_t scene, const outcome *outcomes, unsigned seeds) {
    tally t;
    add_all(&t, outcomes, seeds);
    const char *label = scene == PLR_SCENE_STANDS ? "  by stands" : "  by may-move";
    print_phase(label, "event", &t, DURING);
    print_phase(label, "after", &t, AFTER);
    print_details(s, &t);
    release(&t);
}
