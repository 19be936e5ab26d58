// SPDX-License-Identifier: MIT
#include "state/calibration.h"

#include <string.h>

#include "math/dense.h"
#include "math/finite.h"
#include "math/se3.h"
#include "math/small.h"
#include "math/so3.h"
#include "state/blocks.h"
#include "state/camera.h"
#include "state/covariance.h"
#include "state/pose.h"

enum {
    K = PLR_CALIBRATIONS,
    MOST_SIGMAS = 5,    /* of the prior, in one correction: more is no calibration */
    USUAL_AT_FIRST = 20 /* frames that the prior of what is usual counts */
};

/* What a frame says of the calibration is added up over some 32 frames, seconds of a camera: slow errors
 * of the odometry last as long. */
#define KEPT (PLR_R(1) - PLR_R(1) / PLR_R(32))
/* Added to the variance of that sum, in sigmas of the prior: what is told less of is no evidence. */
#define LITTLE PLR_R(1e-4)

/* ---------------------------------------------------------------- the columns */

static plr_real squared(double x) {
    return (plr_real)(x * x);
}

static void fill_variances(const plr_config *c, plr_real variance[PLR_CALIBRATION_ERRORS]) {
    variance[PLR_BASELINE] = squared(c->baseline_sigma);
    variance[PLR_FOCAL_LENGTH] = squared(c->focal_sigma);
    for (unsigned axis = 0; axis < 3; axis++) {
        variance[PLR_CAMERA_TURN_X + axis] = squared(c->camera_turn_sigma_rad);
        variance[PLR_CAMERA_PLACE_X + axis] = squared(c->camera_place_sigma_m);
    }
    variance[PLR_CENTRE_X] = variance[PLR_CENTRE_Y] = squared(c->centre_sigma_px);
    variance[PLR_CAMERA_CLOCK] = squared(c->camera_clock_sigma_s);
}

/* The part of the calibration, and so of the setting calibrate, that an error belongs to. */
static const uint8_t part_of[PLR_CALIBRATION_ERRORS] = {
    [PLR_BASELINE] = PLR_CALIBRATE_BASELINE,    [PLR_FOCAL_LENGTH] = PLR_CALIBRATE_FOCAL,
    [PLR_CAMERA_TURN_X] = PLR_CALIBRATE_TURN,   [PLR_CAMERA_TURN_Y] = PLR_CALIBRATE_TURN,
    [PLR_CAMERA_TURN_Z] = PLR_CALIBRATE_TURN,   [PLR_CENTRE_X] = PLR_CALIBRATE_CENTRE,
    [PLR_CENTRE_Y] = PLR_CALIBRATE_CENTRE,      [PLR_CAMERA_PLACE_X] = PLR_CALIBRATE_PLACE,
    [PLR_CAMERA_PLACE_Y] = PLR_CALIBRATE_PLACE, [PLR_CAMERA_PLACE_Z] = PLR_CALIBRATE_PLACE,
    [PLR_CAMERA_CLOCK] = PLR_CALIBRATE_CLOCK,
};

void plr_calibration_lay_out(plr_parameters *par, const plr_config *config) {
    plr_calibrated *to = &par->calibrated;
    plr_real variance[PLR_CALIBRATION_ERRORS];
    fill_variances(config, variance);
    memset(to, 0, sizeof *to);
    for (unsigned considered = 0; considered < 2; considered++) {
        for (unsigned kind = 0; kind < PLR_CALIBRATION_ERRORS; kind++) {
            const bool listed = (config->calibrate & part_of[kind]) != 0;
            if (listed == (considered != 0) || !(variance[kind] > 0) || to->count == K)
                continue;
            to->kind[to->count] = (uint8_t)kind;
            to->variance[to->count++] = variance[kind];
        }
        if (!considered)
            to->estimated = to->count;
    }
}

/* ---------------------------------------------------------------- the camera */

/* The column of the camera's clock, or count. */
static unsigned column_of_clock(const plr_filter *f) {
    unsigned k = 0;
    while (k < f->par.calibrated.count && f->par.calibrated.kind[k] != PLR_CAMERA_CLOCK)
        k++;
    return k;
}

/* By its clock the camera was elsewhere: q(t + tau) = Exp(-tau u) q(t), u its twist. */
static void place_eye(plr_filter *f) {
    plr_calibration_estimate *c = &f->calibration;
    plr_real way[PLR_POSE_DIM], R[9], p[3], turned[3];
    const unsigned clock = column_of_clock(f);
    const plr_real tau = clock < f->par.calibrated.count ? c->moved[clock] : PLR_R(0);
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        way[i] = -tau * c->twist[i];
    plr_se3_exp(R, p, way);
    plr_mat3_mul(c->eye.R_CB, c->R, R);
    plr_mat3_vec(turned, c->R, p);
    for (unsigned i = 0; i < 3; i++)
        c->eye.t_CB[i] = c->t[i] + turned[i];
}

void plr_calibration_place(const plr_filter *f, plr_real R[9], plr_real t[3]) {
    const plr_camera *eye = &f->calibration.eye;
    plr_mat3_mul(R, eye->R_CB, f->par.camera.R_CB);
    plr_camera_from_body(t, eye, f->par.camera.t_CB);
}

void plr_calibration_forget(plr_filter *f) {
    plr_calibration_estimate *c = &f->calibration;
    memset(c->information, 0, sizeof c->information);
    memset(c->factor, 0, sizeof c->factor);
    memset(c->sum, 0, sizeof c->sum);
    memset(c->sum_variance, 0, sizeof c->sum_variance);
    c->usual_frames = USUAL_AT_FIRST;
    c->excess = 1;
    for (unsigned k = 0; k < K; k++) {
        c->information[(K + 1) * k] = 1;
        c->factor[(K + 1) * k] = c->told[k] = c->usual[k] = 1;
    }
}

void plr_calibration_reset(plr_filter *f) {
    plr_calibration_estimate *c = &f->calibration;
    memset(c, 0, sizeof *c);
    c->eye = f->par.camera;
    plr_mat3_identity(c->R);
    plr_calibration_forget(f);
    place_eye(f);
}

void plr_calibration_doubt(plr_filter *f) {
    if (plr_calibration_is_off(f))
        plr_calibration_reset(f);
    else
        plr_calibration_forget(f);
}

/* The gain of a Kalman filter in its steady state: the rate walks by so much in a step that it scatters in
 * half a second (a quarter in the mean) as it does beside the readings' noise. At least that of the mean of
 * half a second. */
static plr_real rate_gain(const plr_inertial *s) {
    const plr_real noise = PLR_R(0.5) * s->change2[1], scatter = s->spread2[1] - noise;
    const plr_real least = PLR_R(2) * s->usual_s;
    if (!(noise > 0) || !(scatter > 0))
        return least;
    const plr_real walk = scatter / noise * s->usual_s / PLR_R(0.25);
    const plr_real gain = PLR_R(0.5) * (PLR_SQRT(PLR_FMA(walk, walk, PLR_R(4) * walk)) - walk);
    return gain > least ? gain : least;
}

void plr_calibration_note_rate(plr_filter *f, const plr_real w_B[3]) {
    plr_calibration_estimate *c = &f->calibration;
    const plr_real gain = rate_gain(&f->inertial), left = PLR_R(1) - gain;
    const plr_real noise = PLR_R(0.5) * f->inertial.change2[1];
    if (!f->inertial.started) {
        memcpy(c->rate, f->inertial.slow + 3, sizeof c->rate);
        c->rate_variance = noise * PLR_R(2) * f->inertial.usual_s;
        return;
    }
    c->rate_variance = PLR_FMA(gain * gain, noise, left * left * c->rate_variance);
    for (unsigned i = 0; i < 3; i++)
        c->rate[i] = PLR_FMA(gain, w_B[i] - c->rate[i], c->rate[i]);
}

bool plr_calibration_needs_twist(const plr_filter *f) {
    return plr_calibration_estimated(&f->par.calibrated) > 0 ||
           column_of_clock(f) < f->par.calibrated.count;
}

/* x <- 0, and false, unless it is beyond three sigmas, three numbers whose variances add up to that. */
static bool demand_motion(plr_real x[3], plr_real variance) {
    const bool moves = plr_dot3(x, x) > PLR_R(9) * variance;
    for (unsigned i = 0; i < 3 && !moves; i++)
        x[i] = 0;
    return moves;
}

void plr_calibration_at_frame(plr_filter *f, const plr_real twist_B[PLR_POSE_DIM],
                              const plr_real P_u[PLR_POSE_SQUARE]) {
    plr_real u[PLR_POSE_DIM], variance[2] = {0};
    memcpy(u, twist_B, sizeof u);
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        variance[i / 3] += P_u[(PLR_POSE_DIM + 1) * i];
    if (f->config.process == PLR_PROCESS_IMU) {
        variance[1] = PLR_R(3) * f->calibration.rate_variance;
        for (unsigned i = 0; i < 3; i++)
            u[3 + i] = f->calibration.rate[i] - f->bias[3 + i];
    }
    const bool goes = demand_motion(u, variance[0]), turns = demand_motion(u + 3, variance[1]);
    f->calibration.moves = goes || turns || f->config.mode == PLR_MODE_MAPPING;
    plr_mat6_vec(f->calibration.twist, f->par.Ad_CB, u);
    place_eye(f);
}

/* The camera as it is if each estimated error is ds. */
static void correct_camera(plr_filter *f, const plr_real *ds) {
    plr_calibration_estimate *c = &f->calibration;
    plr_real by[PLR_CALIBRATION_ERRORS] = {0}, turn[9], before[9], t[3];
    for (unsigned k = 0; k < plr_calibration_estimated(&f->par.calibrated); k++) {
        const unsigned kind = f->par.calibrated.kind[k];
        const bool share = kind == PLR_BASELINE || kind == PLR_FOCAL_LENGTH;
        by[kind] = ds[k];
        c->moved[k] += share ? PLR_FMA(c->moved[k], ds[k], ds[k]) : ds[k];
    }
    c->eye.baseline = PLR_FMA(by[PLR_BASELINE], c->eye.baseline, c->eye.baseline);
    c->eye.fx = PLR_FMA(by[PLR_FOCAL_LENGTH], c->eye.fx, c->eye.fx);
    c->eye.fy = PLR_FMA(by[PLR_FOCAL_LENGTH], c->eye.fy, c->eye.fy);
    c->eye.cx += by[PLR_CENTRE_X];
    c->eye.cy += by[PLR_CENTRE_Y];
    memcpy(before, c->R, sizeof before);
    memcpy(t, c->t, sizeof t);
    plr_so3_exp(turn, by + PLR_CAMERA_TURN_X);
    plr_mat3_mul(c->R, turn, before);
    plr_so3_orthonormalise(c->R);
    plr_mat3_vec(c->t, turn, t);
    for (unsigned i = 0; i < 3; i++)
        c->t[i] += by[PLR_CAMERA_PLACE_X + i];
    place_eye(f);
}

/* ---------------------------------------------------------------- what is learnt */

void plr_calibration_begin(plr_filter *f) {
    if (plr_calibration_estimated(&f->par.calibrated) > 0)
        memset(&f->work.learnt, 0, sizeof f->work.learnt);
}

/* sum + a^T b, columns of rows that are ld apart. */
static plr_real add_product(unsigned rows, const plr_real *a, const plr_real *b, unsigned ld,
                            plr_real sum) {
    for (; rows > 0; rows--, a += ld, b += ld)
        sum = PLR_FMA(*a, *b, sum);
    return sum;
}

void plr_calibration_add(plr_filter *f, unsigned rows, const plr_real *E, const plr_real *e,
                         unsigned ld) {
    plr_learnt *to = &f->work.learnt;
    const unsigned all = f->par.calibrated.count;
    for (unsigned k = 0; k < plr_calibration_estimated(&f->par.calibrated); k++) {
        to->eta[k] = -add_product(rows, E + k, e, ld, -to->eta[k]);
        for (unsigned l = k; l < all; l++)
            to->J[K * k + l] = add_product(rows, E + k, E + l, ld, to->J[K * k + l]);
    }
}

void plr_calibration_marginalise(plr_filter *f) {
    plr_learnt *to = &f->work.learnt;
    const plr_noise *noise = &f->work.noise;
    for (unsigned k = 0; k < plr_calibration_estimated(&f->par.calibrated); k++)
        for (unsigned i = 0; i < PLR_POSE_DIM; i++) {
            const plr_real by = noise->eta_of_S[k][i];
            to->eta[k] = PLR_FMA(by, noise->eta[i], to->eta[k]);
            for (unsigned l = k; l < f->par.calibrated.count; l++)
                to->J[K * k + l] = PLR_FMA(-by, noise->eta_of_S[l][i], to->J[K * k + l]);
        }
}

/* Of the priors. */
static void get_sigmas(const plr_filter *f, double sigma[K]) {
    for (unsigned k = 0; k < f->par.calibrated.count; k++)
        sigma[k] = (double)PLR_SQRT(f->par.calibrated.variance[k]);
}

/* The information, each error in sigmas of its prior, += share times what was learnt. */
static void add_information(plr_filter *f, const double sigma[K], double share) {
    for (unsigned k = 0; k < plr_calibration_estimated(&f->par.calibrated); k++)
        for (unsigned l = k; l < f->par.calibrated.count; l++)
            f->calibration.information[K * k + l] +=
                share * sigma[k] * sigma[l] * (double)f->work.learnt.J[K * k + l];
}

/* The information J, where the prior's share counts `excess` times, = L D L^T in the rows of the estimated:
 * L^T above the diagonal of U, D on it. False if a pivot is not above zero. */
static bool factorise(const plr_filter *f, plr_real excess, double *U) {
    const unsigned n = plr_calibration_estimated(&f->par.calibrated);
    for (unsigned k = 0; k < n; k++)
        for (unsigned l = k; l < n; l++) {
            double sum = f->calibration.information[K * k + l];
            if (l == k)
                sum += (double)(excess - PLR_R(1));
            for (unsigned i = 0; i < k; i++)
                sum -= U[K * i + k] * U[K * i + l] * U[(K + 1) * i];
            U[K * k + l] = l == k ? sum : sum / U[(K + 1) * k];
            if (l == k && !(sum > 0))
                return false;
        }
    return true;
}

/* x <- L^-T x */
static void solve_back(unsigned n, const double *U, double *x) {
    for (unsigned k = n; k-- > 0;)
        for (unsigned l = k + 1; l < n; l++)
            x[k] -= U[K * k + l] * x[l];
}

/* x <- J^-1 x */
static void solve(unsigned n, const double *U, double *x) {
    for (unsigned k = 0; k < n; k++)
        for (unsigned i = 0; i < k; i++)
            x[k] -= U[K * i + k] * x[i];
    for (unsigned k = 0; k < n; k++)
        x[k] /= U[(K + 1) * k];
    solve_back(n, U, x);
}

/* The columns of G: of an estimated error that of L^-T, whose variance is excess / D; of one that is
 * considered how it misleads the others. In sigmas of the prior. */
static void factor_covariance(plr_filter *f, const double *U) {
    plr_calibration_estimate *c = &f->calibration;
    const unsigned n = plr_calibration_estimated(&f->par.calibrated);
    double sigma[K];
    get_sigmas(f, sigma);
    for (unsigned k = 0; k < f->par.calibrated.count; k++) {
        double x[K] = {0};
        if (k < n) {
            x[k] = 1;
            solve_back(k + 1, U, x); /* the others stay 0 */
            c->told[k] = (plr_real)((double)c->excess / U[(K + 1) * k]);
        } else {
            for (unsigned j = 0; j < n; j++)
                x[j] = -c->information[K * j + k];
            solve(n, U, x);
        }
        for (unsigned j = 0; j < k && j < n; j++)
            c->factor[K * k + j] = (plr_real)(x[j] * sigma[j] / sigma[k]);
    }
}

bool plr_calibration_take_up(plr_filter *f) {
    double U[K * K];
    const bool good = factorise(f, f->calibration.excess, U);
    if (good)
        factor_covariance(f, U);
    return good;
}

/* The variance of what a frame says of error k beside its estimate, were all errors white, in sigmas of the
 * prior: J + J Sigma J. */
static plr_real score_variance(const plr_filter *f, unsigned k) {
    const plr_calibration_estimate *c = &f->calibration;
    const plr_real *J = f->work.learnt.J;
    plr_real sum = J[(K + 1) * k];
    for (unsigned m = 0; m < plr_calibration_estimated(&f->par.calibrated); m++) {
        plr_real by = 0;
        for (unsigned j = 0; j <= m; j++)
            by = PLR_FMA(c->factor[K * m + j], j < k ? J[K * j + k] : J[K * k + j], by);
        sum = PLR_FMA(f->par.calibrated.variance[m] * c->told[m] * by, by, sum);
    }
    return f->par.calibrated.variance[k] * sum;
}

/* How much more the scores g of several frames add up to than those of one suggest. Errors that are alike
 * from frame to frame do not average out, and the information of the residuals, taken for white, is
 * that much too large: an overdispersion (McCullagh and Nelder, Generalized Linear Models, 1989, 4.5), of
 * a sum because of the correlation. */
static plr_real note_excess(plr_filter *f, const double g[K]) {
    plr_calibration_estimate *c = &f->calibration;
    plr_real largest = 1;
    c->usual_frames += 1;
    for (unsigned k = 0; k < plr_calibration_estimated(&f->par.calibrated); k++) {
        c->sum[k] = PLR_FMA(KEPT, c->sum[k], (plr_real)g[k]);
        c->sum_variance[k] = PLR_FMA(KEPT * KEPT, c->sum_variance[k], score_variance(f, k));
        const plr_real ratio = c->sum[k] * c->sum[k] / (c->sum_variance[k] + LITTLE);
        c->usual[k] += (ratio - c->usual[k]) / c->usual_frames;
        if (c->usual[k] > largest)
            largest = c->usual[k];
    }
    return largest;
}

/* The estimate is that of all frames so far, each of them counting 1/excess of what it says: so what is
 * found out of the excess holds for those before, too. */
void plr_calibration_learn(plr_filter *f) {
    plr_calibration_estimate *c = &f->calibration;
    const unsigned n = plr_calibration_estimated(&f->par.calibrated);
    double U[K * K], x[K], sigma[K];
    plr_real ds[K], excess = 1;
    if (n == 0 || !c->moves)
        return;
    get_sigmas(f, sigma);
    for (unsigned k = 0; k < n; k++)
        x[k] = sigma[k] * (double)f->work.learnt.eta[k];
    if (f->config.process == PLR_PROCESS_TWIST)
        excess = note_excess(f, x);
    for (unsigned k = 0; k < n; k++)
        x[k] -= (double)((excess - c->excess) * c->moved[k]) / sigma[k];
    add_information(f, sigma, 1);
    bool good = factorise(f, excess, U);
    if (good)
        solve(n, U, x);
    for (unsigned k = 0; k < n && good; k++) {
        ds[k] = (plr_real)(x[k] * sigma[k]);
        good = x[k] < MOST_SIGMAS && x[k] > -MOST_SIGMAS;
    }
    if (!good) {
        add_information(f, sigma, -1);
        return;
    }
    c->excess = excess;
    factor_covariance(f, U);
    plr_combine_rows(plr_covariance_dim(f), n, ds, 1, f->S[0], PLR_MAX_LD, f->work.dx);
    correct_camera(f, ds);
}

bool plr_calibration_is_off(const plr_filter *f) {
    for (unsigned k = 0; k < plr_calibration_estimated(&f->par.calibrated); k++) {
        const plr_real moved = f->calibration.moved[k];
        if (moved * moved > PLR_R(16) * f->par.calibrated.variance[k])
            return true;
    }
    return false;
}

/* ---------------------------------------------------------------- what is told */

static void tell_camera(const plr_filter *f, plr_calibration *told) {
    const plr_calibration_estimate *c = &f->calibration;
    plr_real R[9], body[3], t[3];
    plr_mat3_mul(R, c->R, f->par.camera.R_CB);
    plr_mat3_vec(body, f->par.camera.R_CB, f->par.imu_arm);
    for (unsigned i = 0; i < 3; i++)
        body[i] = f->par.camera.t_CB[i] - body[i];
    plr_mat3_vec(t, c->R, body);
    told->fx_px = (double)c->eye.fx;
    told->fy_px = (double)c->eye.fy;
    told->cx_px = (double)c->eye.cx;
    told->cy_px = (double)c->eye.cy;
    told->baseline_m = (double)c->eye.baseline;
    for (unsigned i = 0; i < 9; i++)
        told->T_CB.R[i] = (double)R[i];
    for (unsigned i = 0; i < 3; i++)
        told->T_CB.p[i] = (double)(t[i] + c->t[i]);
}

void plr_calibration_tell(const plr_filter *f, plr_calibration_result *told) {
    const plr_calibration_estimate *c = &f->calibration;
    const plr_calibrated *errors = &f->par.calibrated;
    memset(told, 0, sizeof *told);
    told->t_ns = f->t_ns;
    tell_camera(f, &told->camera);
    for (unsigned j = 0; j < errors->count; j++) {
        plr_real variance = 0;
        for (unsigned k = j; k < errors->count && (j < plr_calibration_estimated(errors) || k == j);
             k++)
            variance = PLR_FMA(c->factor[K * k + j] * c->factor[K * k + j],
                               errors->variance[k] * c->told[k], variance);
        told->corrected[errors->kind[j]] = (double)c->moved[j];
        told->sigma[errors->kind[j]] = (double)PLR_SQRT(variance);
        if (j < plr_calibration_estimated(errors))
            told->estimated |= (uint16_t)(1U << errors->kind[j]);
    }
}
