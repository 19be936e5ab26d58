// SPDX-License-Identifier: MIT
#include "vision/track.h"

#include <string.h>

#include "math/leaky.h"
#include "math/small.h"
#include "math/two.h"
#include "vision/patch.h"

enum { STEPS_COARSE = 5, STEPS_FINEST = 10, CENTRE_MOVES = 4, HALF = PLR_PATCH_SIDE / 2 };

/* Normalised correlation that is enough: with the patch of the birth, with the other picture. */
#define LIKE PLR_R(0.8)
/* On a coarse level, to be believed at all. */
#define LIKE_COARSE PLR_R(0.6)
/* So far from where it begins the finest fit is that of the same patch: half its side, px. */
#define NEAR PLR_R(4)
/* det A at which the patch of the birth shows too little or too much of what is there now. */
#define SMALLEST PLR_R(0.45)
#define LARGEST  PLR_R(2.2)

/* Surfaces face the camera, but for tilts whose tangent has this standard deviation. */
#define TILT PLR_R(2)
/* What is left over is mostly of interpolation, and the same in each pair: one counts as a share of all. */
#define SLOPE_SHARE PLR_R(0.03)
#define SLOPE_KEEP  PLR_R(0.9) /* of what fits tell of a slope, from pair to pair */
#define SLOPE_MOST  PLR_R(1)
enum { SLOPE_FITS = 3 }; /* of a birth */

/* Finds `patch` of so many levels near `at` (px of level 0, in and out), from the level `from` on. `t` becomes
 * the finest one's. */
static bool find(plr_vision *v, const plr_levels *in, const uint8_t (*patch)[PLR_PATCH_BYTES],
                 unsigned from, const plr_real A[4], plr_real at[2], plr_template *t,
                 plr_fit *fit) {
    plr_real start[2] = {at[0], at[1]};
    memset(fit, 0, sizeof *fit);
    for (unsigned level = from + 1; level-- > 0;) {
        fit->likeness = 0;
        if (!plr_template_make(t, patch[level]))
            continue;
        start[0] = at[0], start[1] = at[1];
        fit->at[0] = plr_pyramid_down(at[0], level), fit->at[1] = plr_pyramid_down(at[1], level);
        plr_patch_fit(fit, &in->level[level], t, A, level > 0 ? STEPS_COARSE : STEPS_FINEST);
        v->report.steps = (uint16_t)(v->report.steps + fit->steps);
        if (fit->inside && (level == 0 || fit->likeness > LIKE_COARSE)) {
            at[0] = plr_pyramid_up(fit->at[0], level);
            at[1] = plr_pyramid_up(fit->at[1], level);
        }
    }
    const plr_real x = at[0] - start[0], y = at[1] - start[1];
    fit->ended = fit->ended && PLR_FMA(x, x, y * y) < NEAR * NEAR;
    return fit->inside && fit->ended && fit->likeness > LIKE;
}

/* A patch of each of so many levels around a place; returns how many have one. */
static unsigned cut(const plr_levels *from, const plr_real at[2], unsigned most,
                    uint8_t (*patch)[PLR_PATCH_BYTES]) {
    unsigned level = 0;
    for (; level < most; level++) {
        const plr_real here[2] = {plr_pyramid_down(at[0], level), plr_pyramid_down(at[1], level)};
        if (!plr_patch_cut(&from->level[level], here, patch[level]))
            break;
    }
    return level;
}

/* --- from picture to picture --- */

static bool end(plr_track *t, plr_track_end why) {
    t->why = (uint8_t)why;
    return false;
}

static bool is_inside(const plr_vision *v, const plr_real at[2]) {
    return at[0] >= 0 && at[1] >= 0 && at[0] <= (plr_real)(v->width - 1) &&
           at[1] <= (plr_real)(v->height - 1);
}

bool plr_track_expect(const plr_vision *v, const plr_expected_motion *m, plr_track *t) {
    plr_real to[2], by[4];
    if (!plr_rig_forward(v, m, t->at, &t->surface, to, by))
        return end(t, PLR_TRACK_LEFT_VIEW);
    const plr_real A[4] = {t->A[0], t->A[1], t->A[2], t->A[3]};
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
            t->A[2 * i + j] = PLR_FMA(by[2 * i], A[j], by[2 * i + 1] * A[2 + j]);
    if (m->place_known)
        t->drift[0] = t->drift[1] = 0;
    for (int i = 0; i < 2; i++)
        t->at[i] = to[i] + t->drift[i];
    const plr_real d = plr_det2(t->A);
    if (!is_inside(v, t->at) || !(d > PLR_R(0.05) && d < PLR_R(20)))
        return end(t, PLR_TRACK_LEFT_VIEW);
    return true;
}

bool plr_track_stays(const plr_vision *v, const plr_expected_motion *m, const plr_track *t) {
    plr_real at[2] = {t->at[0], t->at[1]};
    plr_surface surface = t->surface;
    for (int pair = 0; pair < 2; pair++) {
        plr_real to[2], A[4];
        if (!plr_rig_forward(v, m, at, &surface, to, A) || !is_inside(v, to))
            return false;
        at[0] = to[0], at[1] = to[1];
    }
    return true;
}

/* What is seen now becomes the patch; the error of the place in it stays from now on. */
static void cut_anew(plr_vision *v, const plr_scene *s, plr_track *t) {
    uint8_t patch[PLR_VISION_LEVELS][PLR_PATCH_BYTES];
    const unsigned levels = cut(&s->side[PLR_LEFT], t->at, v->levels, patch);
    if (levels == 0)
        return;
    memcpy(t->patch, patch, levels * sizeof patch[0]);
    t->levels = (uint8_t)levels;
    t->A[0] = t->A[3] = 1, t->A[1] = t->A[2] = 0;
    t->var_cut += (t->cov[0] + t->cov[2]) / 2;
    v->report.cut_anew++;
}

bool plr_track_follow(plr_vision *v, const plr_scene *s, plr_track *t) {
    plr_template template;
    plr_fit fit;
    const plr_real expected[2] = {t->at[0], t->at[1]};
    const bool found = find(v, &s->side[PLR_LEFT], (const uint8_t(*)[PLR_PATCH_BYTES])t->patch,
                            t->levels - 1U, t->A, t->at, &template, &fit);
    if (!found)
        return end(t, !fit.inside  ? PLR_TRACK_LEFT_VIEW
                      : !fit.ended ? PLR_TRACK_MOVED
                                   : PLR_TRACK_UNLIKE);
    memcpy(t->cov, fit.cov, sizeof fit.cov);
    for (int i = 0; i < 2; i++)
        t->drift[i] += t->at[i] - expected[i];
    t->likeness = fit.likeness;
    const plr_real d = plr_det2(t->A);
    if (d < SMALLEST || d > LARGEST)
        cut_anew(v, s, t);
    return true;
}

/* Moves a birth by whole px to the centre of its patch: then a deformation that is not quite the expected
 * one moves it least. A centre outside the patch is none. False where the patch has no contrast. */
static bool centre(const plr_image *image, plr_real at[2], uint8_t *patch) {
    plr_template template;
    plr_real c[2];
    for (int moves = 0;; moves++) {
        if (!plr_patch_cut(image, at, patch) || !plr_template_make(&template, patch))
            return false;
        plr_template_centre(&template, c);
        if (moves == CENTRE_MOVES || !(plr_abs(c[0]) < HALF && plr_abs(c[1]) < HALF))
            return true;
        const int x = (int)(c[0] + HALF + PLR_R(0.5)) - HALF;
        const int y = (int)(c[1] + HALF + PLR_R(0.5)) - HALF;
        if (x == 0 && y == 0)
            return true;
        at[0] += (plr_real)x, at[1] += (plr_real)y;
    }
}

bool plr_track_begin(const plr_vision *v, const plr_scene *s, plr_track *t, const plr_real at[2]) {
    memset(t, 0, sizeof *t);
    t->at[0] = at[0], t->at[1] = at[1];
    if (!centre(&s->side[PLR_LEFT].level[0], t->at, t->patch[0]))
        return false;
    t->A[0] = t->A[3] = 1;
    t->likeness = 1;
    t->levels = (uint8_t)cut(&s->side[PLR_LEFT], t->at, v->levels, t->patch);
    t->id = v->next_id;
    return t->levels > 0;
}

/* --- from left to right --- */

enum { SEARCH_WIDEST = 200 }; /* px of the level in which the epipolar line is searched */

#define LIKE_SEARCH PLR_R(0.7)
#define SECOND_BEST PLR_R(0.95) /* of the best: else two places are alike */
#define ROW_GAP     PLR_R(1.5)  /* px of the virtual camera */

/* A place in the right picture by the left patch, cut now: the two share exposure and view. */
static bool fit_right(plr_vision *v, const plr_scene *s, const uint8_t (*patch)[PLR_PATCH_BYTES],
                      unsigned from, const plr_real A[4], plr_track *t, plr_real at[2],
                      plr_template *template) {
    plr_fit fit;
    plr_real X[3], left[2], right[2];
    if (!find(v, &s->side[PLR_RIGHT], patch, from, A, at, template, &fit) ||
        !plr_rig_point(v, &s->motion, PLR_LEFT, t->at, plr_rig_depth(v, t->surface.disparity), X))
        return false;
    plr_rig_virtual(v, PLR_LEFT, X, left);
    if (!plr_rig_point(v, &s->motion, PLR_RIGHT, at, plr_rig_depth(v, t->surface.disparity), X))
        return false;
    plr_rig_virtual(v, PLR_RIGHT, X, right);
    t->row_gap = right[1] - left[1];
    if (plr_abs(t->row_gap) > ROW_GAP)
        return false;
    t->surface.disparity = left[0] - right[0];
    t->right[0] = at[0], t->right[1] = at[1];
    t->var_right = fit.cov[0];
    return true;
}

/* What is known of a slope without any fit: the inverse of its variance. A surface of a tilt has the slope
 * tan(tilt) disparity / f. */
static plr_real slope_prior(const plr_vision *v, const plr_track *t) {
    const plr_real px = t->surface.disparity > 1 ? t->surface.disparity : PLR_R(1);
    const plr_real by = v->fx / (TILT * px);
    return by * by;
}

void plr_track_weigh_slope(plr_real slope[2], plr_real info[3], plr_real prior,
                           const plr_real measured[2], const plr_real fit[3]) {
    plr_real all[3] = {prior + info[0], info[1], prior + info[2]}, sum[2], mean[2];
    for (int i = 0; i < 2; i++)
        sum[i] = plr_leaky_sum(PLR_FMA(all[i], slope[0], all[i + 1] * slope[1]), SLOPE_KEEP,
                               PLR_FMA(fit[i], measured[0], fit[i + 1] * measured[1]));
    for (int i = 0; i < 3; i++) {
        info[i] = plr_leaky_sum(info[i], SLOPE_KEEP, fit[i]);
        all[i] = info[i] + (i == 1 ? 0 : prior);
    }
    if (!(PLR_FMA(all[0], all[2], -(all[1] * all[1])) > PLR_R(1e-4) * all[0] * all[2]))
        return;
    plr_solve2_symmetric(mean, all, sum);
    for (int i = 0; i < 2; i++)
        slope[i] = mean[i] > SLOPE_MOST    ? SLOPE_MOST
                   : mean[i] < -SLOPE_MOST ? -SLOPE_MOST
                                           : mean[i];
}

/* What the fit at `at` leaves over tells how the surface lies. */
static void learn_slope(const plr_vision *v, const plr_scene *s, const plr_template *template,
                        const plr_real A[4], plr_track *t, const plr_real at[2]) {
    plr_real beside[2], c[2], change[2], info[3];
    plr_surface nearer = t->surface;
    nearer.disparity += 1;
    if (!plr_rig_across(v, &s->motion, t->at, &t->surface, c, NULL) ||
        !plr_rig_across(v, &s->motion, t->at, &nearer, beside, NULL) ||
        !(plr_abs(plr_det2(A)) > PLR_R(0.01)))
        return;
    const plr_real e[2] = {beside[0] - c[0], beside[1] - c[1]};
    plr_solve2(c, A, e);
    if (!plr_patch_slope(&s->side[PLR_RIGHT].level[0], template, at, A, c, change, info))
        return;
    for (int i = 0; i < 3; i++)
        info[i] *= SLOPE_SHARE;
    const plr_real measured[2] = {t->surface.slope[0] + change[0], t->surface.slope[1] + change[1]};
    plr_track_weigh_slope(t->surface.slope, t->slope_info, slope_prior(v, t), measured, info);
}

/* The two likeliest places along the line. */
typedef struct plr_candidates {
    plr_real best, best_disparity, second;
} plr_candidates;

/* Keeps the best, and the best of those more than two steps away from it. */
static void keep(plr_candidates *c, plr_real likeness, plr_real disparity, plr_real step) {
    const bool beside = plr_abs(disparity - c->best_disparity) < PLR_R(2.5) * step;
    if (likeness > c->best) {
        if (!beside && c->best > c->second)
            c->second = c->best;
        c->best = likeness, c->best_disparity = disparity;
    } else if (!beside && likeness > c->second) {
        c->second = likeness;
    }
}

static unsigned search_level(const plr_vision *v, unsigned levels) {
    unsigned level = 0;
    while (level + 1 < levels && v->width >> level > SEARCH_WIDEST)
        level++;
    return level;
}

/* Where along the epipolar line the patch is likeliest; `mirror`: on the other side of infinity. */
static bool search_line(plr_vision *v, const plr_scene *s, const plr_track *t, const uint8_t *patch,
                        unsigned level, bool mirror, plr_real *disparity) {
    plr_template template;
    plr_candidates c = {-1, -1000, -1};
    plr_surface surface = {0, {0, 0}};
    plr_real infinity[2], A[4];
    const plr_real step = (plr_real)(1U << level);
    const plr_image *image = &s->side[PLR_RIGHT].level[level];
    if (!plr_template_make(&template, patch) ||
        !plr_rig_across(v, &s->motion, t->at, &surface, infinity, A))
        return false;
    for (plr_real d = mirror ? 4 * step : 0; d <= (plr_real)v->disparity_max; d += step) {
        plr_real at[2];
        surface.disparity = d;
        if (!plr_rig_across(v, &s->motion, t->at, &surface, at, NULL))
            continue;
        for (int i = 0; i < 2; i++)
            at[i] = plr_pyramid_down(mirror ? 2 * infinity[i] - at[i] : at[i], level);
        keep(&c, plr_patch_likeness(image, &template, at, A), d, step);
    }
    *disparity = c.best_disparity;
    return c.best > LIKE_SEARCH && c.second < SECOND_BEST * c.best;
}

bool plr_track_match(plr_vision *v, const plr_scene *s, plr_track *t, bool birth) {
    uint8_t patch[2][PLR_PATCH_BYTES];
    plr_template template;
    plr_real at[2], A[4];
    const unsigned level = search_level(v, t->levels);
    if (birth && !search_line(v, s, t, t->patch[level], level, false, &t->surface.disparity))
        return false;
    const unsigned wanted = search_level(v, v->levels) > 0 ? 2 : 1;
    unsigned levels = cut(&s->side[PLR_LEFT], t->at, wanted, patch);
    for (int fits = birth ? SLOPE_FITS : 1; fits > 0 && levels > 0; fits--, levels = 1) {
        if (!plr_rig_across(v, &s->motion, t->at, &t->surface, at, A) ||
            !fit_right(v, s, (const uint8_t(*)[PLR_PATCH_BYTES])patch, levels - 1, A, t, at,
                       &template))
            return false;
        learn_slope(v, s, &template, A, t, at);
    }
    return levels > 0;
}

bool plr_track_mirrored(plr_vision *v, const plr_scene *s, const plr_track *t) {
    plr_real disparity;
    const unsigned level = search_level(v, t->levels);
    return search_line(v, s, t, t->patch[level], level, true, &disparity);
}
