// SPDX-License-Identifier: MIT
#include "vision/lens.h"

#include "math/small.h"
#include "math/so3.h"
#include "math/two.h"

enum { NEWTON_STEPS = 12 };

/* A step so small ends Newton's method: in units of the focal length some 1e-3 px. */
#define SMALL_STEP PLR_R(1e-6)

/* --- radial and tangential --- */

/* d = x rad + (2 p1 x y + p2 (r2 + 2 x^2), p1 (r2 + 2 y^2) + 2 p2 x y) with
 * rad = (1 + k1 r2 + k2 r4 + k3 r6) / (1 + k4 r2 + k5 r4 + k6 r6); J (2x2) its derivatives. */
static void distort(const plr_real k[8], const plr_real x[2], plr_real d[2], plr_real J[4]) {
    const plr_real xx = x[0] * x[0], yy = x[1] * x[1], xy = x[0] * x[1], r2 = xx + yy;
    const plr_real top = PLR_FMA(r2, PLR_FMA(r2, PLR_FMA(r2, k[4], k[1]), k[0]), PLR_R(1));
    const plr_real low = PLR_FMA(r2, PLR_FMA(r2, PLR_FMA(r2, k[7], k[6]), k[5]), PLR_R(1));
    const plr_real top_by_r2 = PLR_FMA(r2, PLR_FMA(r2, 3 * k[4], 2 * k[1]), k[0]);
    const plr_real low_by_r2 = PLR_FMA(r2, PLR_FMA(r2, 3 * k[7], 2 * k[6]), k[5]);
    const plr_real rad = top / low, slope = 2 * (PLR_FMA(-rad, low_by_r2, top_by_r2) / low);
    const plr_real p1 = k[2], p2 = k[3];
    d[0] = PLR_FMA(x[0], rad, PLR_FMA(2 * p1, xy, p2 * PLR_FMA(PLR_R(2), xx, r2)));
    d[1] = PLR_FMA(x[1], rad, PLR_FMA(2 * p2, xy, p1 * PLR_FMA(PLR_R(2), yy, r2)));
    J[0] = PLR_FMA(slope, xx, rad) + PLR_FMA(2 * p1, x[1], 6 * p2 * x[0]);
    J[1] = J[2] = PLR_FMA(slope, xy, PLR_FMA(2 * p1, x[0], 2 * p2 * x[1]));
    J[3] = PLR_FMA(slope, yy, rad) + PLR_FMA(2 * p2, x[0], 6 * p1 * x[1]);
}

/* Whether the formula is still one to one: where its Jacobian has lost its sign, it has folded. */
static bool unfolded(const plr_real J[4]) {
    return plr_det2(J) > PLR_R(1e-3) && J[0] + J[3] > 0;
}

/* x with distort(x) = d, by Newton's method from d. */
static bool undistort(const plr_real k[8], const plr_real d[2], plr_real x[2]) {
    x[0] = d[0], x[1] = d[1];
    for (int step = 0; step < NEWTON_STEPS; step++) {
        plr_real found[2], J[4], by[2];
        distort(k, x, found, J);
        if (!unfolded(J))
            return false;
        const plr_real off[2] = {d[0] - found[0], d[1] - found[1]};
        plr_solve2(by, J, off);
        x[0] += by[0], x[1] += by[1];
        if (plr_abs(by[0]) + plr_abs(by[1]) < SMALL_STEP * (1 + plr_abs(x[0]) + plr_abs(x[1])))
            return true;
    }
    return false;
}

/* --- equidistant --- */

/* theta (1 + k1 theta^2 + ... + k4 theta^8), and its derivative. */
static plr_real bent(const plr_real k[8], plr_real theta, plr_real *slope) {
    const plr_real t2 = theta * theta;
    *slope =
        PLR_FMA(t2, PLR_FMA(t2, PLR_FMA(t2, PLR_FMA(t2, 9 * k[3], 7 * k[2]), 5 * k[1]), 3 * k[0]),
                PLR_R(1));
    return theta *
           PLR_FMA(t2, PLR_FMA(t2, PLR_FMA(t2, PLR_FMA(t2, k[3], k[2]), k[1]), k[0]), PLR_R(1));
}

/* theta with bent(theta) = radius. */
static bool unbent(const plr_real k[8], plr_real radius, plr_real *theta) {
    *theta = radius;
    for (int step = 0; step < NEWTON_STEPS; step++) {
        plr_real slope;
        const plr_real miss = radius - bent(k, *theta, &slope);
        if (!(slope > PLR_R(1e-3)))
            return false;
        const plr_real by = miss / slope;
        *theta += by;
        if (plr_abs(by) < SMALL_STEP * (1 + *theta))
            return *theta < PLR_R(3.1) && *theta > -SMALL_STEP;
    }
    return false;
}

/* theta <- theta + sin(phi - theta): the error is cubed each time. */
plr_real plr_lens_angle(plr_real adjacent, plr_real opposite) {
    const plr_real most = plr_abs(adjacent) > opposite ? plr_abs(adjacent) : opposite;
    if (!(most > 0))
        return 0;
    const bool steep = opposite > plr_abs(adjacent);
    const plr_real t = (steep ? plr_abs(adjacent) : opposite) / most; /* 0 to 1 */
    plr_real theta = t * PLR_FMA(PLR_R(-0.2146), t, PLR_R(1.0));      /* atan t, to 0.02 */
    if (steep)
        theta = PLR_R(1.5707963267948966) - theta;
    if (adjacent < 0)
        theta = PLR_R(3.1415926535897932) - theta;
    for (int step = 0; step < 2; step++) {
        plr_so3_series s;
        const plr_real t2 = theta * theta;
        plr_so3_series_at(&s, t2);
        theta += PLR_FMA(opposite, PLR_FMA(-t2, s.b, PLR_R(1)), -(adjacent * (s.a * theta)));
    }
    return theta;
}

/* --- both --- */

bool plr_lens_ray(const plr_optics *o, const plr_real px[2], plr_real ray[3]) {
    const plr_real d[2] = {(px[0] - o->cx) / o->fx, (px[1] - o->cy) / o->fy};
    ray[0] = d[0], ray[1] = d[1], ray[2] = 1;
    if (o->model == PLR_LENS_NONE)
        return true;
    if (o->model == PLR_LENS_RADTAN)
        return undistort(o->k, d, ray);
    const plr_real radius = PLR_SQRT(PLR_FMA(d[0], d[0], d[1] * d[1]));
    plr_real theta;
    plr_so3_series s;
    if (!unbent(o->k, radius, &theta))
        return false;
    plr_so3_series_at(&s, theta * theta);
    const plr_real by = radius > PLR_R(1e-6) ? theta * s.a / radius : PLR_R(1);
    ray[0] = d[0] * by, ray[1] = d[1] * by;
    ray[2] = PLR_FMA(-(theta * theta), s.b, PLR_R(1));
    return true;
}

bool plr_lens_pixel(const plr_optics *o, const plr_real ray[3], plr_real px[2]) {
    plr_real d[2] = {0, 0};
    if (o->model == PLR_LENS_EQUIDISTANT) {
        const plr_real across = PLR_FMA(ray[0], ray[0], ray[1] * ray[1]);
        const plr_real length = PLR_SQRT(PLR_FMA(ray[2], ray[2], across)), r = PLR_SQRT(across);
        if (!(length > 0))
            return false;
        plr_real slope;
        const plr_real radius = bent(o->k, plr_lens_angle(ray[2] / length, r / length), &slope);
        if (!(slope > PLR_R(1e-3)))
            return false;
        const plr_real by = r > PLR_R(1e-6) * length ? radius / r : 1 / length;
        d[0] = ray[0] * by, d[1] = ray[1] * by;
    } else {
        if (!(ray[2] > PLR_R(1e-3) * (plr_abs(ray[0]) + plr_abs(ray[1]))))
            return false;
        const plr_real x[2] = {ray[0] / ray[2], ray[1] / ray[2]};
        plr_real J[4] = {1, 0, 0, 1};
        if (o->model == PLR_LENS_RADTAN)
            distort(o->k, x, d, J);
        else
            d[0] = x[0], d[1] = x[1];
        if (!unfolded(J))
            return false;
    }
    px[0] = PLR_FMA(o->fx, d[0], o->cx);
    px[1] = PLR_FMA(o->fy, d[1], o->cy);
    return true;
}
