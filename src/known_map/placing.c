// SPDX-License-Identifier: MIT
#include "known_map/placing.h"

#include <string.h>

#include "math/dense.h"
#include "math/small.h"
#include "math/so3.h"
#include "sensor/stereo.h"

enum {
    TRIALS = 40, /* with two wrong in five, none of them is of three right ones once in 17,000 */
    STEPS = 4    /* of Gauss and Newton */
};

/* An observation agrees with a pose below this: chi-square, 4 degrees of freedom, once in 2000. */
#define KNOWN_AGREES_BELOW PLR_R(20)
/* Three points fix a pose well enough to begin with if their disparities are two of their
 * sigmas, and if the triangle is as high as a tenth of the longer of two of its sides. */
#define DISPARITY_SIGMAS PLR_R(2)
#define LEAST_HEIGHT     PLR_R(0.1)
/* Keeps the equations regular along what no point determines. */
#define SMALL_SHARE PLR_R(1e-5)
#define TINY        PLR_R(1e-12)

typedef struct plr_sights {
    const plr_camera_model *camera;
    plr_seen_known *seen;
    unsigned count;
    const plr_placing *prior;              /* NULL: none */
    plr_real information[PLR_POSE_SQUARE]; /* of it */
} plr_sights;

/* The equations of Gauss and Newton for a small motion (rho, theta) of the camera. */
typedef struct plr_normal {
    plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN]; /* U^T U: the information, packed upper */
    plr_real b[PLR_POSE_DIM];
} plr_normal;

/* ---------------------------------------------------------------- one point */

/* Whitened: e of the residual and, where J is not NULL, J of the prediction by the motion, 3x6.
 * False if the point would be too near, or behind. */
static bool look(const plr_sights *s, const plr_seen_known *known, const plr_placing *at,
                 plr_real e[3], plr_real *J) {
    const plr_camera_model *camera = s->camera;
    plr_real q[3], Dz[9], DzR[9], DzRP[9], S[9], U[6];
    plr_mat3_vec(q, at->R, known->w);
    for (unsigned i = 0; i < 3; i++)
        q[i] += at->t[i];
    if (!(q[2] >= camera->min_depth))
        return false;
    plr_stereo_project(e, &camera->estimate.eye, q);
    plr_stereo_jacobian(Dz, &camera->estimate.eye, q);
    plr_mat3_mul(DzR, Dz, at->R);
    plr_mat3_mul(DzRP, DzR, known->P);
    plr_mat3_mul_nt(S, DzRP, DzR);
    for (unsigned i = 0; i < 3; i++) {
        e[i] = known->z[i] - e[i];
        S[4 * i] += i == 2 ? PLR_R(0.5) * known->pixel_variance : known->pixel_variance;
    }
    if (!plr_factorise3(U, S))
        return false;
    plr_solve3_transposed(1, U, e);
    if (!J)
        return true;
    for (unsigned row = 0; row < 3; row++) {
        memcpy(J + PLR_POSE_DIM * row, Dz + 3 * row, 3 * sizeof *J);
        plr_cross3(J + PLR_POSE_DIM * row + 3, q, Dz + 3 * row); /* a row of -Dz [q]x */
    }
    plr_solve3_transposed(PLR_POSE_DIM, U, J);
    return true;
}

/* Marks the points that agree with the pose. Returns how many. */
static unsigned mark_agreeing(const plr_sights *s, const plr_placing *at) {
    unsigned agreeing = 0;
    for (unsigned i = 0; i < s->count; i++) {
        plr_real e[3];
        plr_seen_known *known = &s->seen[i];
        known->agrees =
            look(s, known, at, e, NULL) && plr_dot3(e, e) + known->gap_d2 < KNOWN_AGREES_BELOW;
        agreeing += known->agrees;
    }
    return agreeing;
}

/* ---------------------------------------------------------------- the pose */

/* Adds the points that agree and would be seen. */
static void add_points(const plr_sights *s, const plr_placing *at, plr_normal *normal) {
    for (unsigned i = 0; i < s->count; i++) {
        plr_real e[3], J[PLR_ROWS * PLR_POSE_DIM];
        if (!s->seen[i].agrees || !look(s, &s->seen[i], at, e, J))
            continue;
        for (unsigned row = 0; row < PLR_ROWS; row++) {
            const plr_real *of_row = J + PLR_POSE_DIM * row;
            plr_upper6_add(normal->U, of_row, of_row);
            for (unsigned k = 0; k < PLR_POSE_DIM; k++)
                normal->b[k] = PLR_FMA(of_row[k], e[row], normal->b[k]);
        }
    }
}

/* Adds what is known besides: a pose, with the inverse of its covariance. */
static void add_prior(const plr_sights *s, const plr_placing *at, plr_normal *normal) {
    plr_real turn[9], turned[3], gap[PLR_POSE_DIM], by_prior[PLR_POSE_DIM];
    plr_mat3_mul_nt(turn, s->prior->R, at->R);
    plr_mat3_vec(turned, turn, at->t);
    for (unsigned i = 0; i < 3; i++)
        gap[i] = s->prior->t[i] - turned[i];
    plr_turn_of(gap + 3, turn);
    plr_mat6_vec(by_prior, s->information, gap);
    for (unsigned r = 0, i = 0; r < PLR_POSE_DIM; r++) {
        normal->b[r] += by_prior[r];
        for (unsigned c = r; c < PLR_POSE_DIM; c++, i++)
            normal->U[i] += s->information[PLR_POSE_DIM * r + c];
    }
}

/* The equations of the points that agree, and of the prior if there is one, factorised. False if
 * they do not determine the pose. */
static bool fill_equations(const plr_sights *s, const plr_placing *at, plr_normal *normal) {
    memset(normal, 0, sizeof *normal);
    add_points(s, at, normal);
    if (s->prior)
        add_prior(s, at, normal);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        plr_real *diagonal = normal->U + plr_upper_row(PLR_POSE_DIM, k);
        *diagonal += PLR_FMA(SMALL_SHARE, *diagonal, TINY);
    }
    return plr_cholesky_upper(PLR_POSE_DIM, normal->U);
}

/* Some steps on the points that agree. */
static bool improve(const plr_sights *s, plr_placing *at) {
    for (unsigned step = 0; step < STEPS; step++) {
        plr_normal normal;
        plr_real R[9], before[9], turned[3], *motion = normal.b;
        if (!fill_equations(s, at, &normal))
            return false;
        plr_solve_upper_transposed(PLR_POSE_DIM, 1, normal.U, motion, 1);
        plr_solve_upper(PLR_POSE_DIM, normal.U, motion);
        if (!(plr_dot3(motion + 3, motion + 3) < 1))
            return false;
        plr_so3_exp(R, motion + 3);
        memcpy(before, at->R, sizeof before);
        plr_mat3_mul(at->R, R, before);
        plr_so3_orthonormalise(at->R);
        plr_mat3_vec(turned, R, at->t);
        for (unsigned i = 0; i < 3; i++)
            at->t[i] = turned[i] + motion[i];
    }
    return true;
}

/* Orthonormal axes of a triangle, as columns: along its first side, across it, and off its
 * plane. False if it is nearly a line. */
static bool axes_of(const plr_real a[3], const plr_real b[3], const plr_real c[3],
                    plr_real axes[9]) {
    plr_real ab[3], ac[3], x[3], y[3], z[3];
    for (unsigned i = 0; i < 3; i++) {
        ab[i] = b[i] - a[i];
        ac[i] = c[i] - a[i];
    }
    plr_cross3(z, ab, ac);
    const plr_real ab2 = plr_dot3(ab, ab), ac2 = plr_dot3(ac, ac), area2 = plr_dot3(z, z);
    const plr_real longer2 = ab2 > ac2 ? ab2 : ac2;
    if (!(area2 > LEAST_HEIGHT * LEAST_HEIGHT * longer2 * longer2))
        return false;
    for (unsigned i = 0; i < 3; i++) {
        x[i] = ab[i] / PLR_SQRT(ab2);
        z[i] /= PLR_SQRT(area2);
    }
    plr_cross3(y, z, x);
    for (unsigned i = 0; i < 3; i++) {
        axes[3 * i] = x[i];
        axes[3 * i + 1] = y[i];
        axes[3 * i + 2] = z[i];
    }
    return true;
}

/* The pose from three points: the triangles laid upon each other, which depends on the depths,
 * and from there the best one in the pixels. */
static bool place_by_three(const plr_sights *s, const unsigned of[3], plr_placing *at) {
    plr_real q[3][3], Dq[9], in_camera[9], in_world[9], turned[3];
    for (unsigned k = 0; k < 3; k++)
        plr_stereo_back_project(q[k], Dq, &s->camera->estimate.eye, s->seen[of[k]].z);
    if (!axes_of(q[0], q[1], q[2], in_camera) ||
        !axes_of(s->seen[of[0]].w, s->seen[of[1]].w, s->seen[of[2]].w, in_world))
        return false;
    plr_mat3_mul_nt(at->R, in_camera, in_world);
    plr_mat3_vec(turned, at->R, s->seen[of[0]].w);
    for (unsigned i = 0; i < 3; i++)
        at->t[i] = q[0][i] - turned[i];
    for (unsigned i = 0; i < s->count; i++)
        s->seen[i].agrees = i == of[0] || i == of[1] || i == of[2];
    return improve(s, at);
}

/* The points near enough for a sample of three. Returns how many. */
static unsigned find_near(const plr_sights *s, uint8_t near[PLR_PLACING_MOST]) {
    unsigned count = 0;
    for (unsigned i = 0; i < s->count; i++) {
        const plr_real sigma = PLR_SQRT(2 * s->seen[i].pixel_variance);
        if (s->seen[i].z[0] - s->seen[i].z[1] > DISPARITY_SIGMAS * sigma)
            near[count++] = (uint8_t)i;
    }
    return count;
}

/* Three different ones of `near`, by a linear congruential generator. */
static void draw(uint32_t *state, const uint8_t *near, unsigned count, unsigned of[3]) {
    for (unsigned k = 0; k < 3; k++) {
        *state = *state * 1664525u + 1013904223u;
        unsigned at = (*state >> 16) % (count - k); /* among those not drawn yet */
        for (unsigned before = 0; before < k; before++)
            at += at >= of[before];
        unsigned sorted = k; /* of: ascending, so that the line above skips each once */
        for (; sorted > 0 && of[sorted - 1] > at; sorted--)
            of[sorted] = of[sorted - 1];
        of[sorted] = at;
    }
    for (unsigned k = 0; k < 3; k++)
        of[k] = near[of[k]];
}

/* A^-1 = U^-1 U^-T, of A = U^T U. */
static void invert(const plr_real *U, plr_real inverse[PLR_POSE_SQUARE]) {
    plr_real X[PLR_POSE_SQUARE] = {0};
    for (unsigned k = 0; k < PLR_POSE_DIM; k++)
        X[(PLR_POSE_DIM + 1) * k] = 1;
    plr_solve_upper_transposed(PLR_POSE_DIM, PLR_POSE_DIM, U, X, PLR_POSE_DIM);
    for (unsigned r = 0; r < PLR_POSE_DIM; r++)
        for (unsigned c = 0; c < PLR_POSE_DIM; c++) {
            plr_real sum = 0;
            for (unsigned l = 0; l < PLR_POSE_DIM; l++)
                sum = PLR_FMA(X[PLR_POSE_DIM * l + r], X[PLR_POSE_DIM * l + c], sum);
            inverse[PLR_POSE_DIM * r + c] = sum;
        }
}

/* From a guess, by all points. Returns how many agree with it then. */
static unsigned place_by_guess(const plr_sights *s, plr_placing *at) {
    for (unsigned i = 0; i < s->count; i++)
        s->seen[i].agrees = true;
    return improve(s, at) ? mark_agreeing(s, at) : 0;
}

/* From samples of three, if they are better than `most` points. Returns how many agree. */
static unsigned place_by_samples(const plr_sights *s, unsigned most, plr_placing *placing) {
    uint8_t near[PLR_PLACING_MOST];
    const unsigned nears = find_near(s, near);
    uint32_t random = 1; /* the same samples in every frame: the same bits everywhere */
    for (unsigned trial = 0; nears >= 3 && most < s->count && trial < TRIALS; trial++) {
        unsigned of[3];
        plr_placing at;
        draw(&random, near, nears, of);
        const unsigned agreeing = place_by_three(s, of, &at) ? mark_agreeing(s, &at) : 0;
        if (agreeing > most) {
            most = agreeing;
            *placing = at;
        }
    }
    return most;
}

unsigned plr_place(const plr_camera_model *camera, plr_seen_known *seen, unsigned count,
                   const plr_placing *guess, plr_placing *placing) {
    const plr_sights s = {.camera = camera, .seen = seen, .count = count};
    unsigned most = 0;
    plr_normal normal;
    if (guess) {
        *placing = *guess;
        most = place_by_guess(&s, placing);
    }
    if (most < count) { /* not all agree: samples may find a better one */
        most = place_by_samples(&s, most, placing);
        most = most > 0 ? mark_agreeing(&s, placing) : 0;
    }
    for (unsigned round = 0; round < 2; round++) {
        if (most < PLR_PLACING_LEAST || !improve(&s, placing))
            return 0;
        most = mark_agreeing(&s, placing);
    }
    if (most < PLR_PLACING_LEAST || !fill_equations(&s, placing, &normal))
        return 0;
    invert(normal.U, placing->P_C);
    return most;
}

/* A pose of which one axis is known far better than another would not be positive in float32. */
static void keep_regular(const plr_real P[PLR_POSE_SQUARE], plr_real U[PLR_POSE_TRIANGLE]) {
    for (unsigned half = 0; half < PLR_POSE_DIM; half += 3) {
        plr_real trace = 0;
        for (unsigned k = half; k < half + 3; k++)
            trace += P[(PLR_POSE_DIM + 1) * k];
        for (unsigned k = half; k < half + 3; k++)
            U[plr_upper_row(PLR_POSE_DIM, k)] += PLR_FMA(SMALL_SHARE, trace, TINY);
    }
}

unsigned plr_place_by_prior(const plr_camera_model *camera, plr_seen_known *seen, unsigned count,
                            const plr_placing *prior, plr_placing *placing) {
    plr_sights s = {.camera = camera, .seen = seen, .count = count, .prior = prior};
    plr_real U[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN];
    plr_upper6_pack(U, prior->P_C);
    keep_regular(prior->P_C, U);
    if (!plr_cholesky_upper(PLR_POSE_DIM, U))
        return 0;
    invert(U, s.information);
    *placing = *prior;
    const unsigned agreeing = place_by_guess(&s, placing);
    if (agreeing == 0 || agreeing == count)
        return agreeing;
    return improve(&s, placing) ? mark_agreeing(&s, placing) : 0; /* without the others */
}
