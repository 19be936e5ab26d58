// SPDX-License-Identifier: MIT
#include "vision/patch.h"

#include "math/small.h"
#include "math/two.h"
#include "vision/kernels.h"

enum { HALF = PLR_PATCH_SIDE / 2, KEPT_HALF = PLR_PATCH_KEPT / 2, FINE = 6 };

#define UNIT     PLR_R(65536)
#define STEP_MAX PLR_R(2)    /* px */
#define STEP_END PLR_R(0.02) /* px */
/* Of a step, as the last two tell it. */
#define SHARE_LEAST PLR_R(0.25)
#define SHARE_MOST  PLR_R(2)
/* Grey levels' noise that no residual may claim to be below: rounding to whole levels, twice. */
#define GREY_VAR PLR_R(2.0 / 12 * PLR_GREY * PLR_GREY)
/* What a patch that fits exactly is still off by: the last step, rounded weights; px^2. */
#define FLOOR_VAR PLR_R(0.03 * 0.03)
/* A patch whose place this noise alone makes uncertain by half a pixel has no contrast. */
#define WEAKEST (GREY_VAR * PLR_R(4))

/* --- cutting --- */

/* Places of a window of so many px each way that stay inside, with the neighbour that is interpolated. */
static bool inside(const plr_image *image, const plr_real at[2], plr_real across, plr_real down) {
    const plr_real right = (plr_real)image->width - PLR_R(1.01);
    const plr_real low = (plr_real)image->height - PLR_R(1.01);
    return at[0] >= across && at[0] + across <= right && at[1] >= down && at[1] + down <= low;
}

/* Rounded to the weights' resolution. */
static int32_t fixed(plr_real x) {
    return (int32_t)(x * UNIT) + (1 << (PLR_FRACTION - PLR_WEIGHT - 1));
}

bool plr_patch_cut(const plr_image *image, const plr_real at[2], uint8_t patch[PLR_PATCH_BYTES]) {
    if (!inside(image, at, KEPT_HALF, KEPT_HALF))
        return false;
    plr_patch_sample(image, fixed(at[0]) - KEPT_HALF * (1 << PLR_FRACTION),
                     fixed(at[1]) - KEPT_HALF * (1 << PLR_FRACTION), patch);
    return true;
}

/* sum a b - sum a sum b / n: the sum of products without the means. */
static plr_real central(int64_t sum_ab, int32_t sum_a, int32_t sum_b) {
    return (plr_real)(sum_ab * PLR_SAMPLES - (int64_t)sum_a * sum_b) / PLR_SAMPLES;
}

bool plr_template_make(plr_template *t, const uint8_t patch[PLR_PATCH_BYTES]) {
    plr_template_sums s;
    plr_template_fill(t, patch, &s);
    t->sum_T = s.T, t->sum_Jx = s.Jx, t->sum_Jy = s.Jy;
    t->TT = central(s.TT, s.T, s.T);
    t->JxT = central(s.xT, s.Jx, s.T), t->JyT = central(s.yT, s.Jy, s.T);
    t->H[0] = central(s.xx, s.Jx, s.Jx), t->H[1] = central(s.xy, s.Jx, s.Jy);
    t->H[2] = central(s.yy, s.Jy, s.Jy);
    const plr_real det = PLR_FMA(t->H[0], t->H[2], -(t->H[1] * t->H[1]));
    /* the smaller eigenvalue is at least det / trace */
    return t->TT > 0 && det > WEAKEST * (t->H[0] + t->H[2]);
}

void plr_template_centre(const plr_template *t, plr_real centre[2]) {
    int32_t S = 0, xS = 0, yS = 0;
    for (int j = 0, k = 0; j < PLR_PATCH_SIDE; j++)
        for (int i = 0; i < PLR_PATCH_SIDE; i++, k++) {
            /* J is a multiple of PLR_GREY / 2 */
            const int32_t s = (t->Jx[k] * (i - HALF) + t->Jy[k] * (j - HALF)) / (PLR_GREY / 2);
            S += s, xS += t->Jx[k] * s, yS += t->Jy[k] * s;
        }
    const plr_real b[2] = {PLR_GREY / 2 * central(xS, S, t->sum_Jx),
                           PLR_GREY / 2 * central(yS, S, t->sum_Jy)};
    plr_solve2_symmetric(centre, t->H, b);
}

/* --- sums --- */

bool plr_grid_place(plr_grid *g, const plr_image *image, const plr_real at[2],
                    const plr_real A[4]) {
    const plr_real across = HALF * (plr_abs(A[0]) + plr_abs(A[1]));
    const plr_real down = HALF * (plr_abs(A[2]) + plr_abs(A[3]));
    if (!(across < PLR_R(64)) || !(down < PLR_R(64)) ||
        !inside(image, at, across + PLR_R(0.05), down + PLR_R(0.05)))
        return false;
    g->x = fixed(at[0]), g->y = fixed(at[1]);
    for (int i = 0; i < 4; i++)
        g->A[i] = (int32_t)(A[i] * UNIT);
    return true;
}

/* --- fits --- */

/* The sums without their means. */
typedef struct plr_centred {
    plr_real II, IT, IJx, IJy;
} plr_centred;

static plr_centred centred(const plr_patch_sums *s, const plr_template *t) {
    const plr_centred c = {central(s->II, s->I, s->I), central(s->IT, s->I, t->sum_T),
                           central(s->IJx, s->I, t->sum_Jx), central(s->IJy, s->I, t->sum_Jy)};
    return c;
}

static plr_real correlation(const plr_centred *c, const plr_template *t) {
    return c->II > 0 ? c->IT / PLR_SQRT(c->II * t->TT) : PLR_R(0);
}

plr_real plr_patch_likeness(const plr_image *image, const plr_template *t, const plr_real at[2],
                            const plr_real A[4]) {
    plr_grid g;
    plr_patch_sums s;
    if (!plr_grid_place(&g, image, at, A))
        return -1;
    plr_patch_sum(&s, image, &g, t);
    const plr_centred c = centred(&s, t);
    return correlation(&c, t);
}

/* cov = A (2 var S^-1 H S^-1 + floor I) A^T, var the noise of one picture, S = H less what noise adds to the
 * squares of J. Interpolation has averaged a part of the noise out of the residuals: they have 1.44 var. */
static void uncertainty(plr_fit *fit, const plr_template *t, const plr_real A[4],
                        plr_real squares) {
    const plr_real residual = (squares > 0 ? squares : 0) / (PLR_SAMPLES - 4) + GREY_VAR;
    const plr_real var = residual / PLR_R(1.44), *H = t->H;
    const plr_real weaker = PLR_FMA(H[0], H[2], -(H[1] * H[1])) / (H[0] + H[2]);
    const plr_real noise = PLR_SAMPLES / 2 * var, most = weaker / 2;
    const plr_real less = noise < most ? noise : most;
    const plr_real S[3] = {H[0] - less, H[1], H[2] - less};
    plr_real AS[2][2];
    for (int i = 0; i < 2; i++)
        plr_solve2_symmetric(AS[i], S, A + 2 * i);
    for (int k = 0; k < 3; k++) {
        const int i = k / 2, j = (k + 1) / 2;
        const plr_real AA = PLR_FMA(A[2 * i], A[2 * j], A[2 * i + 1] * A[2 * j + 1]);
        fit->cov[k] = PLR_FMA(2 * var, plr_product2(AS[i], H, AS[j]), FLOOR_VAR * AA);
    }
}

/* One step's d from the place of the grid; false where the picture has no contrast there. */
static bool step(plr_fit *fit, const plr_image *image, const plr_grid *g, const plr_template *t,
                 plr_real d[2], plr_real *squares) {
    plr_patch_sums s;
    plr_patch_sum(&s, image, g, t);
    const plr_centred c = centred(&s, t);
    fit->likeness = correlation(&c, t);
    fit->steps++;
    if (!(c.II > 0))
        return false;
    const plr_real gain = PLR_SQRT(t->TT / c.II);
    const plr_real b[2] = {PLR_FMA(gain, c.IJx, -t->JxT), PLR_FMA(gain, c.IJy, -t->JyT)};
    plr_solve2_symmetric(d, t->H, b);
    /* |g I~ - T~|^2, less what the step takes off */
    *squares = 2 * (t->TT - gain * c.IT) - PLR_FMA(d[0], b[0], d[1] * b[1]);
    return true;
}

/* The share of a step d that ends the swing of the last one. */
static plr_real share_of(const plr_real d[2], const plr_real last[2], plr_real share) {
    const plr_real x = d[0] - last[0], y = d[1] - last[1], change = PLR_FMA(x, x, y * y);
    if (change > 0)
        share *= -PLR_FMA(last[0], x, last[1] * y) / change;
    return share < SHARE_LEAST ? SHARE_LEAST : share < SHARE_MOST ? share : SHARE_MOST;
}

void plr_patch_fit(plr_fit *fit, const plr_image *image, const plr_template *t, const plr_real A[4],
                   unsigned most_steps) {
    plr_grid g;
    plr_real d[2], last[2] = {0, 0}, share = 1, squares = 0;
    fit->ended = false;
    fit->likeness = 0;
    for (fit->steps = 0; fit->steps < most_steps && !fit->ended;) {
        fit->inside = plr_grid_place(&g, image, fit->at, A);
        if (!fit->inside || !step(fit, image, &g, t, d, &squares))
            return;
        share = fit->steps > 1 ? share_of(d, last, share) : PLR_R(1);
        last[0] = d[0], last[1] = d[1];
        const plr_real length = share * PLR_SQRT(PLR_FMA(d[0], d[0], d[1] * d[1]));
        const plr_real cut = length > STEP_MAX ? share * STEP_MAX / length : share;
        d[0] *= cut, d[1] *= cut;
        fit->at[0] = PLR_FMA(-A[0], d[0], PLR_FMA(-A[1], d[1], fit->at[0]));
        fit->at[1] = PLR_FMA(-A[2], d[0], PLR_FMA(-A[3], d[1], fit->at[1]));
        fit->ended = length < STEP_END;
    }
    fit->inside = plr_grid_place(&g, image, fit->at, A);
    uncertainty(fit, t, A, squares);
}

/* --- slopes --- */

/* Columns of a sample: Jx, Jy, K = (J c) o and the residual r. */
enum { OF_J = 0, OF_K = 2, OF_R = 4, OF_ALL = 5 };

/* The upper triangle of M <- the sums of the columns' products, without their means. */
static void sum_slopes(plr_real M[OF_ALL][OF_ALL], const plr_image *image, const plr_grid *g,
                       const plr_template *t, int32_t gain, const int32_t c[2]) {
    int64_t products[OF_ALL][OF_ALL] = {{0}};
    int32_t sum[OF_ALL] = {0};
    for (int j = -HALF, k = 0; j <= HALF; j++)
        for (int i = -HALF; i <= HALF; i++, k++) {
            const int32_t I = plr_sample(image, g->x + i * g->A[0] + j * g->A[1],
                                         g->y + i * g->A[2] + j * g->A[3]);
            const int32_t along = (t->Jx[k] * c[0] + t->Jy[k] * c[1]) / (1 << FINE);
            const int32_t column[OF_ALL] = {t->Jx[k], t->Jy[k], along * i, along * j,
                                            gain * I / (1 << FINE) - t->T[k]};
            for (int a = 0; a < OF_ALL; a++) {
                sum[a] += column[a];
                for (int b = 0; b <= a; b++)
                    products[a][b] += (int64_t)column[a] * column[b];
            }
        }
    for (int a = 0; a < OF_ALL; a++)
        for (int b = 0; b <= a; b++)
            M[b][a] = central(products[a][b], sum[a], sum[b]);
}

/* What a column explains of those behind it is taken off. False where it explains nothing. */
static bool eliminate(plr_real M[OF_ALL][OF_ALL], int p) {
    if (!(M[p][p] > 0))
        return false;
    for (int a = p + 1; a < OF_ALL; a++) {
        const plr_real share = M[p][a] / M[p][p];
        for (int b = a; b < OF_ALL; b++)
            M[a][b] = PLR_FMA(-share, M[p][b], M[a][b]);
    }
    return true;
}

bool plr_patch_slope(const plr_image *image, const plr_template *t, const plr_real at[2],
                     const plr_real A[4], const plr_real c[2], plr_real change[2],
                     plr_real info[3]) {
    plr_grid g;
    plr_patch_sums p;
    plr_real M[OF_ALL][OF_ALL];
    if (!plr_grid_place(&g, image, at, A) || !(plr_abs(c[0]) < 4 && plr_abs(c[1]) < 4))
        return false;
    plr_patch_sum(&p, image, &g, t);
    const plr_centred centre = centred(&p, t);
    const plr_real gain = centre.II > 0 ? PLR_SQRT(t->TT / centre.II) : PLR_R(0);
    if (!(gain > PLR_R(0.1) && gain < 10))
        return false;
    const int32_t fine[2] = {(int32_t)(c[0] * (1 << FINE)), (int32_t)(c[1] * (1 << FINE))};
    sum_slopes(M, image, &g, t, (int32_t)(gain * (1 << FINE)), fine);
    if (!eliminate(M, OF_J) || !eliminate(M, OF_J + 1)) /* a move of the place is no slope */
        return false;
    const plr_real b[2] = {-M[OF_K][OF_R], -M[OF_K + 1][OF_R]};
    for (int i = 0; i < 3; i++)
        info[i] = M[OF_K + i / 2][OF_K + (i + 1) / 2];
    if (!eliminate(M, OF_K) || !eliminate(M, OF_K + 1))
        return false;
    plr_solve2_symmetric(change, info, b);
    const plr_real rest = M[OF_R][OF_R] > 0 ? M[OF_R][OF_R] : 0;
    for (int i = 0; i < 3; i++)
        info[i] /= 2 * (rest / (PLR_SAMPLES - 6) + GREY_VAR);
    return true;
}
