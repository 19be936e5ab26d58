// SPDX-License-Identifier: MIT
#include "filter/trial.h"

#include <string.h>

#include "math/dense.h"
#include "math/small.h"
#include "sensor/stereo.h"

/* A point decides when one motion is more likely than the other by this, in -2 ln of the likelihood. */
#define CLEAR_DIFFERENCE PLR_R(25)
/* It fits a motion if its cost exceeds the expected one by less than this many standard deviations. */
#define FITTING_SIGMAS PLR_R(4)
/* The range of a point is known if the inverse range is this many of its standard deviations. */
#define RANGE_SIGMAS PLR_R(5)
/* One frame adds no more than this to the cost: a wrong match is not to decide. */
#define MOST_COST PLR_R(16)

/* A pair of pixels as y = (x/z, y/z, 1/z): linear in the pixels. */
static void measure(const plr_filter *f, const plr_observation *seen, plr_real y[3]) {
    const plr_camera *camera = &f->par.camera;
    plr_real z[3];
    plr_stereo_rows(z, seen);
    y[0] = (z[0] - camera->cx) / camera->fx;
    y[1] = (z[2] - camera->cy) / camera->fy;
    y[2] = (z[0] - z[1]) / (camera->fx * camera->baseline);
}

/* The covariance of its noise, 3x3. */
static void measurement_noise(const plr_filter *f, plr_real N[9]) {
    const plr_camera *camera = &f->par.camera;
    const plr_real by_u = PLR_R(1) / camera->fx, by_v = PLR_R(1) / camera->fy;
    const plr_real by_disparity = PLR_R(1) / (camera->fx * camera->baseline);
    memset(N, 0, 9 * sizeof *N);
    N[0] = plr_stereo_variance(f, 0) * by_u * by_u;
    N[2] = N[6] = plr_stereo_variance(f, 0) * by_u * by_disparity;
    N[4] = plr_stereo_variance(f, 2) * by_v * by_v;
    N[8] = (plr_stereo_variance(f, 0) + plr_stereo_variance(f, 1)) * by_disparity * by_disparity;
}

static void unpack(const plr_real P[6], plr_real S[9]) {
    for (unsigned r = 0, k = 0; r < 3; r++)
        for (unsigned c = r; c < 3; c++, k++)
            S[3 * r + c] = S[3 * c + r] = P[k];
}

static void pack(const plr_real S[9], plr_real P[6]) {
    for (unsigned r = 0, k = 0; r < 3; r++)
        for (unsigned c = r; c < 3; c++, k++)
            P[k] = S[3 * r + c];
}

/* y after the camera has moved by (R, p), and the derivative F by y: with m = R^T ((y0, y1, 1) - y2 p)
 * it is (m0, m1, y2) / m2. False if the point would lie behind the camera. */
static bool move(plr_real y[3], plr_real F[9], const plr_real R[9], const plr_real p[3]) {
    const plr_real ray[3] = {PLR_FMA(-y[2], p[0], y[0]), PLR_FMA(-y[2], p[1], y[1]),
                             PLR_FMA(-y[2], p[2], PLR_R(1))};
    const plr_real nearest = PLR_R(0.05); /* of its former depth */
    plr_real m[3], by_range[3];
    plr_mat3_tvec(m, R, ray);
    plr_mat3_tvec(by_range, R, p);
    if (!(m[2] > nearest))
        return false;
    const plr_real inverse = PLR_R(1) / m[2];
    const plr_real after[3] = {m[0] * inverse, m[1] * inverse, y[2] * inverse};
    for (unsigned c = 0; c < 3; c++) {
        const plr_real dm[3] = {c < 2 ? R[3 * c] : -by_range[0],
                                c < 2 ? R[3 * c + 1] : -by_range[1],
                                c < 2 ? R[3 * c + 2] : -by_range[2]};
        F[c] = inverse * PLR_FMA(-after[0], dm[2], dm[0]);
        F[3 + c] = inverse * PLR_FMA(-after[1], dm[2], dm[1]);
        F[6 + c] = inverse * PLR_FMA(-after[2], dm[2], c == 2 ? PLR_R(1) : PLR_R(0));
    }
    memcpy(y, after, sizeof after);
    return true;
}

/* S += the motions' noise at y: G (y2^2 way I + turn [m]x [m]x^T) G^T, m = (y0, y1, 1), G = dy/dm. */
static void add_motion_noise(plr_real S[9], const plr_real y[3], const plr_candidates *c) {
    const plr_real G[9] = {1, 0, -y[0], 0, 1, -y[1], 0, 0, -y[2]};
    const plr_real cross[9] = {0, -1, y[1], 1, 0, -y[0], -y[1], y[0], 0};
    plr_real by_turn[9], way[9], turn[9];
    plr_mat3_mul(by_turn, G, cross);
    plr_mat3_mul_nt(way, G, G);
    plr_mat3_mul_nt(turn, by_turn, by_turn);
    const plr_real k = c->way_variance * y[2] * y[2];
    for (unsigned i = 0; i < 9; i++)
        S[i] += PLR_FMA(k, way[i], c->turn_variance * turn[i]);
}

/* One covariance serves all motions: that under the twists'. */
bool plr_trial_follow(const plr_filter *f, plr_trial *t, const plr_observation *seen,
                      const plr_candidates *c) {
    plr_real F[9], FS[9], S[9], N[9], U[6], X[9], K[9], z[3];
    for (unsigned h = PLR_MOTIONS; h-- > 0;) /* the twists' last: F is that one's */
        if (!move(t->y[h], F, c->motion[h].R, c->motion[h].p))
            return false;
    unpack(t->covariance, S);
    plr_mat3_mul(FS, F, S);
    plr_mat3_mul_nt(S, FS, F);
    add_motion_noise(S, t->y[PLR_BY_TWISTS], c);
    measurement_noise(f, N);
    for (unsigned i = 0; i < 9; i++)
        N[i] += S[i];
    if (!plr_factorise3(U, N))
        return false;
    memcpy(X, S, sizeof X);
    plr_solve3_transposed(3, U, X); /* U^-T S */
    measure(f, seen, z);
    for (unsigned h = 0; h < PLR_MOTIONS; h++) {
        plr_real e[3], d[3];
        for (unsigned i = 0; i < 3; i++)
            e[i] = z[i] - t->y[h][i];
        plr_solve3_transposed(1, U, e);
        const plr_real d2 = plr_dot3(e, e);
        const bool plausible = d2 < MOST_COST;
        t->cost[h] += plausible ? d2 : MOST_COST;
        plr_mat3_tvec(d, X, e);
        for (unsigned i = 0; i < 3 && plausible; i++)
            t->y[h][i] += d[i];
    }
    plr_mat3_mul_tn(K, X, X);
    for (unsigned i = 0; i < 9; i++)
        S[i] -= K[i];
    pack(S, t->covariance);
    t->frames += PLR_R(1);
    return true;
}

/* True if its range is known. Points that are too far for it say nothing of the way; what they dislike
 * about the pictures' motion is the noise of its steps. */
static bool is_near(const plr_trial *t) {
    const plr_real inverse_range = t->y[PLR_BY_TWISTS][2];
    return inverse_range > 0 &&
           inverse_range * inverse_range > RANGE_SIGMAS * RANGE_SIGMAS * t->covariance[5];
}

plr_vote plr_trial_vote(const plr_trial *t) {
    const plr_real dof = PLR_ROWS * (t->frames - PLR_R(1));
    const plr_real fits = dof + FITTING_SIGMAS * PLR_SQRT(PLR_R(2) * dof);
    const plr_real twists = t->cost[PLR_BY_TWISTS];
    const plr_real pictures = t->cost[PLR_BY_PICTURES] < t->cost[PLR_BY_PICTURES_WAY]
                                  ? t->cost[PLR_BY_PICTURES]
                                  : t->cost[PLR_BY_PICTURES_WAY];
    if (twists < fits && pictures > twists + CLEAR_DIFFERENCE)
        return is_near(t) ? PLR_VOTE_TWISTS : PLR_VOTE_OPEN;
    if (pictures < fits && twists > pictures + CLEAR_DIFFERENCE)
        return PLR_VOTE_PICTURES;
    if (twists > fits + CLEAR_DIFFERENCE && pictures > fits + CLEAR_DIFFERENCE)
        return PLR_VOTE_NEITHER;
    return PLR_VOTE_OPEN;
}

void plr_trial_set_id(plr_real halves[2], uint32_t id) {
    halves[0] = (plr_real)(id >> 16);
    halves[1] = (plr_real)(id & 0xFFFFU);
}

bool plr_trial_is_id(const plr_real halves[2], uint32_t id) {
    return halves[0] == (plr_real)(id >> 16) && halves[1] == (plr_real)(id & 0xFFFFU);
}

bool plr_trial_is_of(const plr_trial *t, uint32_t id) {
    return t->frames > 0 && plr_trial_is_id(t->id, id);
}

void plr_trial_begin(const plr_filter *f, plr_trial *t, const plr_observation *seen) {
    plr_real N[9];
    memset(t, 0, sizeof *t);
    plr_trial_set_id(t->id, seen->id);
    t->frames = 1;
    for (unsigned h = 0; h < PLR_MOTIONS; h++)
        measure(f, seen, t->y[h]);
    measurement_noise(f, N);
    pack(N, t->covariance);
}
