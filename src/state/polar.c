// SPDX-License-Identifier: MIT
#include "state/polar.h"

#include "math/small.h"
#include "math/so3.h"
#include "pelorus/assertions.h"

/* N(mu) for a unit vector mu. */
static void basis(plr_real N[2][3], const plr_real mu[3]) {
    const plr_real sign = mu[2] < 0 ? PLR_R(-1) : PLR_R(1);
    const plr_real a = PLR_R(-1) / (sign + mu[2]);
    const plr_real b = mu[0] * mu[1] * a;
    N[0][0] = PLR_FMA(sign * mu[0] * mu[0], a, PLR_R(1));
    N[0][1] = sign * b;
    N[0][2] = -sign * mu[0];
    N[1][0] = b;
    N[1][1] = PLR_FMA(mu[1] * mu[1], a, sign);
    N[1][2] = -mu[1];
}

void plr_polar_at(plr_polar *chart, const plr_real q[3]) {
    chart->r = PLR_SQRT(plr_dot3(q, q));
    const plr_real inverse = PLR_R(1) / chart->r;
    for (int i = 0; i < 3; i++)
        chart->mu[i] = q[i] * inverse;
    basis(chart->N, chart->mu);
}

void plr_polar_from_point(plr_real Jw[9], const plr_polar *chart) {
    const plr_real inverse = PLR_R(1) / chart->r;
    for (int j = 0; j < 3; j++) {
        Jw[j] = chart->N[0][j] * inverse;
        Jw[3 + j] = chart->N[1][j] * inverse;
        Jw[6 + j] = -chart->mu[j] * inverse * inverse;
    }
}

void plr_polar_to_point(plr_real Ji[9], const plr_polar *chart) {
    const plr_real r = chart->r;
    for (int i = 0; i < 3; i++) {
        Ji[3 * i] = r * chart->N[0][i];
        Ji[3 * i + 1] = r * chart->N[1][i];
        Ji[3 * i + 2] = -r * r * chart->mu[i];
    }
}

/* M = N(mu+)^T Exp(a) N(mu), 2x2, with Exp(a) = I + E. */
static void bearing_transport(plr_real M[4], const plr_polar *to, const plr_real E[9],
                              const plr_polar *from) {
    for (int column = 0; column < 2; column++) {
        plr_real turned[3];
        plr_mat3_vec(turned, E, from->N[column]);
        for (int i = 0; i < 3; i++)
            turned[i] += from->N[column][i];
        for (int row = 0; row < 2; row++)
            M[2 * row + column] = plr_dot3(to->N[row], turned);
    }
}

bool plr_polar_retract(plr_polar *result, plr_real M[4], const plr_polar *chart,
                       const plr_real w[3], plr_real min_inverse_range, plr_real q[3],
                       plr_real *beyond) {
    PLR_ASSERT(min_inverse_range >= PLR_R(0));
    bool cut = false;
    plr_real w1 = w[0], w2 = w[1];
    const plr_real turn2 = PLR_FMA(w2, w2, w1 * w1);
    if (turn2 > 1) {
        const plr_real shrink = PLR_R(1) / PLR_SQRT(turn2);
        w1 *= shrink;
        w2 *= shrink;
        cut = true;
    }
    plr_real along[3], a[3], E[9];
    for (int i = 0; i < 3; i++)
        along[i] = PLR_FMA(chart->N[1][i], w2, chart->N[0][i] * w1);
    plr_cross3(a, chart->mu, along);
    plr_so3_expm1(E, a);

    plr_real inverse = PLR_R(1) / chart->r + w[2];
    bool held = false;
    *beyond = 0;
    if (!(inverse >= min_inverse_range)) {
        *beyond = inverse - min_inverse_range;
        if (!(*beyond <= 0)) { /* NaN */
            *beyond = 0;
            cut = true;
        }
        inverse = min_inverse_range;
        held = true;
    } else if (inverse > PLR_R(1) / PLR_MIN_RANGE) {
        inverse = PLR_R(1) / PLR_MIN_RANGE;
        cut = held = true;
    }
    result->r = PLR_R(1) / inverse;
    plr_real turn[3];
    plr_mat3_vec(turn, E, chart->mu);
    /* r+ - r = -r r+ w_3; and q+ - q = (r+ - r) (mu + turn) + r turn */
    const plr_real further = held ? result->r - chart->r : -chart->r * result->r * w[2];
    const plr_real mu[3] = {chart->mu[0] + turn[0], chart->mu[1] + turn[1], chart->mu[2] + turn[2]};
    if (further < PLR_R(-0.25) * chart->r) {
        /* else the rounding of the far point would stay in the near one */
        const plr_real scale = result->r / PLR_SQRT(plr_dot3(mu, mu));
        for (int i = 0; i < 3; i++)
            q[i] = scale * mu[i];
    } else {
        for (int i = 0; i < 3; i++)
            q[i] += PLR_FMA(further, mu[i], chart->r * turn[i]);
    }
    plr_polar_at(result, q);
    bearing_transport(M, result, E, chart);
    return cut;
}
