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
    LEARNT_SIGMAS = 4,  /* by which a number may have moved, of what is learnt of it */
    MOST_MISFITS = 10,  /* frames that would move it farther, until it is refused */
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

/* By how much later than its stamp a picture was taken, s. */
static plr_real offset_of_clock(const plr_filter *f) {
    const unsigned clock = column_of_clock(f);
    return clock < f->par.calibrated.count ? f->calibration.moved[clock] : PLR_R(0);
}

/* By its clock the camera was elsewhere: q(t + tau) = Exp(-tau u) q(t), u its mean twist over tau. */
static void place_eye(plr_filter *f) {
    plr_calibration_estimate *c = &f->calibration;
    plr_real way[PLR_POSE_DIM], R[9], p[3], turned[3];
    const plr_real tau = offset_of_clock(f);
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        way[i] = -tau * c->mean_twist[i];
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
    memset(c->factor, 0, sizeof c->factor);
    memset(c->sum, 0, sizeof c->sum);
    memset(c->sum_variance, 0, sizeof c->sum_variance);
    c->usual_frames = USUAL_AT_FIRST;
    c->excess = 1;
    for (unsigned k = 0; k < K; k++) {
        c->factor[(K + 1) * k] = c->told[k] = c->usual[k] = 1;
    }
}

static void begin_at_prior(plr_filter *f) {
    plr_calibration_estimate *c = &f->calibration;
    memset(c->moved, 0, sizeof c->moved);
    memset(c->t, 0, sizeof c->t);
    c->eye = f->par.camera;
    plr_mat3_identity(c->R);
    place_eye(f);
}

void plr_calibration_reset(plr_filter *f) {
    memset(&f->calibration, 0, sizeof f->calibration);
    plr_calibration_forget(f);
    begin_at_prior(f);
}

void plr_calibration_doubt(plr_filter *f) {
    if (plr_calibration_is_off(f))
        plr_calibration_reset(f);
    else
        plr_calibration_forget(f);
}

/* The gain of a Kalman filter in its steady state: the rate walks by so much in a step that it scatters in
 * half a second (a quarter in the mean) as it does beside the readings' noise. At least that of the mean of
 * half a second, at most that of a twentieth: a column that is late by so much is hardly less like the rate, but
 * its noise is in the innovations too, and draws the clock's offset towards zero. */
static plr_real rate_gain(const plr_inertial *s) {
    const plr_real noise = PLR_R(0.5) * s->change2[1], scatter = s->spread2[1] - noise;
    const plr_real least = PLR_R(2) * s->usual_s, most = PLR_R(20) * s->usual_s;
    if (!(noise > 0) || !(scatter > 0))
        return least;
    const plr_real walk = scatter / noise * s->usual_s / PLR_R(0.25);
    const plr_real gain = PLR_R(0.5) * (PLR_SQRT(PLR_FMA(walk, walk, PLR_R(4) * walk)) - walk);
    return gain < least ? least : gain > most && most < PLR_R(1) ? most : gain;
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

void plr_calibration_note_step(plr_filter *f, const plr_real reading[PLR_POSE_DIM],
                               plr_real seconds) {
    plr_calibration_estimate *c = &f->calibration;
    if (column_of_clock(f) == f->par.calibrated.count)
        return;
    memmove(c->step + 1, c->step, sizeof c->step - sizeof c->step[0]);
    c->step[0][0] = seconds;
    memcpy(c->step[0] + 1, reading + 3, 3 * sizeof *reading);
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

/* mean += share times the mean rate, bias included, of the time from `begin` to `end` seconds ago; w stands
 * for what is not kept. */
static void add_mean_rate(const plr_filter *f, plr_real begin, plr_real end, const plr_real w[3],
                          plr_real share, plr_real mean[3]) {
    const plr_real each = share / (begin - end);
    plr_real at = 0;
    for (unsigned k = 0; k <= PLR_CLOCK_STEPS && at < begin; k++) {
        const plr_real *step = k < PLR_CLOCK_STEPS ? f->calibration.step[k] : NULL;
        const plr_real *rate = step ? step + 1 : w;
        const plr_real next = step && at + step[0] < begin ? at + step[0] : begin;
        const plr_real seconds = next - (at > end ? at : end);
        for (unsigned i = 0; i < 3 && seconds > 0; i++)
            mean[i] = PLR_FMA(each * seconds, rate[i], mean[i]);
        at = next;
    }
}

/* The mean rate over the camera's offset, bias included. In the past it is that of the steps by which the body was
 * turned: so their noise, which stands in the pose, is taken back with them. Of the future it is what goes
 * on evenly: the last mean and its change. */
static void mean_rate(const plr_filter *f, plr_real tau, const plr_real w[3], plr_real mean[3]) {
    memset(mean, 0, 3 * sizeof *mean);
    if (tau < 0) {
        add_mean_rate(f, -tau, 0, w, 1, mean);
    } else if (tau > 0) {
        add_mean_rate(f, tau, 0, w, 2, mean);
        add_mean_rate(f, 2 * tau, tau, w, -1, mean);
    } else {
        memcpy(mean, w, 3 * sizeof *mean);
    }
}

void plr_calibration_at_frame(plr_filter *f, const plr_real twist_B[PLR_POSE_DIM],
                              const plr_real change[3], const plr_real P_u[PLR_POSE_SQUARE]) {
    const bool imu = f->config.process == PLR_PROCESS_IMU;
    const plr_real tau = offset_of_clock(f);
    plr_real u[PLR_POSE_DIM], mean[PLR_POSE_DIM], variance[2] = {0};
    memcpy(u, twist_B, sizeof u);
    for (unsigned i = 0; i < PLR_POSE_DIM; i++)
        variance[i / 3] += P_u[(PLR_POSE_DIM + 1) * i];
    if (imu) {
        variance[1] = PLR_R(3) * f->calibration.rate_variance;
        for (unsigned i = 0; i < 3; i++)
            u[3 + i] = f->calibration.rate[i] - f->bias[3 + i];
    }
    const bool goes = demand_motion(u, variance[0]), turns = demand_motion(u + 3, variance[1]);
    for (unsigned i = 0; i < 3; i++)
        mean[i] = goes ? PLR_FMA(PLR_R(0.5) * tau, change[i], u[i]) : PLR_R(0);
    mean_rate(f, tau, f->calibration.rate, mean + 3);
    for (unsigned i = 3; i < PLR_POSE_DIM; i++)
        mean[i] = turns && imu ? mean[i] - f->bias[i] : u[i];
    f->calibration.moves = goes || turns || f->config.mode == PLR_MODE_MAPPING;
    plr_mat6_vec(f->calibration.twist, f->par.Ad_CB, u);
    plr_mat6_vec(f->calibration.mean_twist, f->par.Ad_CB, mean);
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

static plr_real dot(unsigned n, const plr_real *a, const plr_real *b) {
    plr_real sum = 0;
    for (unsigned i = 0; i < n; i++)
        sum = PLR_FMA(a[i], b[i], sum);
    return sum;
}

/* y += a x */
static void add(unsigned n, plr_real a, const plr_real *x, plr_real *y) {
    for (unsigned i = 0; i < n; i++)
        y[i] = PLR_FMA(a, x[i], y[i]);
}

/* y = J x, J of the estimated errors, x the first `size` of them. */
static void times_learnt(const plr_filter *f, unsigned size, const plr_real *x, plr_real *y) {
    const plr_real *J = f->work.learnt.J; /* an upper triangle */
    for (unsigned i = 0; i < plr_calibration_estimated(&f->par.calibrated); i++) {
        y[i] = 0;
        for (unsigned j = 0; j < size; j++)
            y[i] = PLR_FMA(i < j ? J[K * i + j] : J[K * j + i], x[j], y[i]);
    }
}

/* Sigma = G D G^T, row k of G the column of error k, once J is known of the estimated. The columns are
 * conjugate, g_i^T Sigma^-1 g_k = 0, and of each is taken off what makes it so by Sigma^-1 + J; 1 / D_k is what
 * that gives of g_k itself. So nothing is ever inverted, and float32 will do: it is a square root filter
 * (Bierman, Factorization Methods for Discrete Sequential Estimation, 1977). False if J is none. */
static bool correct_factor(const plr_filter *f, plr_real *G, plr_real *D) {
    for (unsigned k = 0; k < plr_calibration_estimated(&f->par.calibrated); k++) {
        plr_real *g = G + K * k, Jg[K];
        times_learnt(f, k + 1, g, Jg);
        plr_real pivot = PLR_R(1) / D[k] + dot(k + 1, g, Jg);
        for (unsigned i = 0; i < k; i++) {
            const plr_real both = dot(i + 1, G + K * i, Jg), share = both * D[i];
            pivot = PLR_FMA(-share, both, pivot);
            add(i + 1, -share, G + K * i, g);
        }
        if (!(pivot > 0) || !plr_is_finite(pivot))
            return false;
        D[k] = PLR_R(1) / pivot;
    }
    return true;
}

/* x += Sigma y, of the estimated errors. */
static void add_product(const plr_filter *f, const plr_real *G, const plr_real *D,
                        const plr_real *y, plr_real *x) {
    for (unsigned k = 0; k < plr_calibration_estimated(&f->par.calibrated); k++)
        add(k + 1, D[k] * dot(k + 1, G + K * k, y), G + K * k, x);
}

bool plr_calibration_is_sound(const plr_filter *f) {
    for (unsigned k = 0; k < plr_calibration_estimated(&f->par.calibrated); k++)
        if (!(f->calibration.told[k] > 0))
            return false;
    return true;
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
static plr_real note_excess(plr_filter *f) {
    plr_calibration_estimate *c = &f->calibration;
    plr_real largest = 1;
    c->usual_frames += 1;
    for (unsigned k = 0; k < plr_calibration_estimated(&f->par.calibrated); k++) {
        const plr_real sigma = PLR_SQRT(f->par.calibrated.variance[k]);
        c->sum[k] = PLR_FMA(KEPT, c->sum[k], sigma * f->work.learnt.eta[k]);
        c->sum_variance[k] = PLR_FMA(KEPT * KEPT, c->sum_variance[k], score_variance(f, k));
        const plr_real ratio = c->sum[k] * c->sum[k] / (c->sum_variance[k] + LITTLE);
        c->usual[k] += (ratio - c->usual[k]) / c->usual_frames;
        if (c->usual[k] > largest)
            largest = c->usual[k];
    }
    return largest;
}

/* What is learnt counts 1/excess of what it says, that of all frames so far too: so as the excess grows,
 * prior and what it was drawn to gain weight beside it. */
static plr_real weigh_prior(plr_filter *f) {
    plr_calibration_estimate *c = &f->calibration;
    plr_learnt *learnt = &f->work.learnt;
    const plr_real excess = f->config.process == PLR_PROCESS_TWIST ? note_excess(f) : c->excess;
    for (unsigned k = 0; k < plr_calibration_estimated(&f->par.calibrated); k++) {
        const plr_real more = (excess - c->excess) / f->par.calibrated.variance[k];
        learnt->J[(K + 1) * k] += more;
        learnt->eta[k] = PLR_FMA(-more, c->moved[k], learnt->eta[k]);
    }
    return excess;
}

/* How each error that is considered misleads those that are estimated: -Sigma times the information that
 * they share. */
static void mislead(plr_filter *f, plr_real *G, const plr_real *D) {
    const unsigned n = plr_calibration_estimated(&f->par.calibrated);
    for (unsigned k = n; k < f->par.calibrated.count; k++) {
        plr_real less[K];
        times_learnt(f, n, G + K * k, less);
        for (unsigned i = 0; i < n; i++)
            less[i] = -(less[i] + f->work.learnt.J[K * i + k]);
        add_product(f, G, D, less, G + K * k);
    }
}

/* The variance of error j, of the columns G and D of a factor. */
static plr_real variance_of(const plr_filter *f, const plr_real *G, const plr_real *D, unsigned j) {
    plr_real variance = 0;
    for (unsigned k = j; k < plr_calibration_estimated(&f->par.calibrated); k++)
        variance = PLR_FMA(G[K * k + j] * G[K * k + j], D[k], variance);
    return variance;
}

/* What is learnt of a number moves it from its prior's mean by N(0, P_0 - P), with P_0 the variance of its prior and P
 * what is left: no farther than that information lets it. Else it is no calibration that the residuals show. */
static bool may_move(const plr_filter *f, const plr_real *G, const plr_real *D, unsigned k,
                     plr_real excess, plr_real ds) {
    const plr_real prior = f->par.calibrated.variance[k];
    const plr_real learnt = prior - excess * variance_of(f, G, D, k);
    const plr_real moved = f->calibration.moved[k] + ds;
    return moved * moved <= PLR_R(LEARNT_SIGMAS * LEARNT_SIGMAS) * (learnt + LITTLE * prior);
}

static bool is_refused(const plr_filter *f, unsigned k) {
    return f->calibration.misfits[k] >= MOST_MISFITS;
}

/* The state and the camera as if nothing had been learnt: what was moved is no error of the calibration. A number
 * that is refused is considered from now on, and the others are learnt anew. */
static void put_back(plr_filter *f) {
    plr_calibration_estimate *c = &f->calibration;
    plr_real back[K];
    for (unsigned k = 0; k < plr_calibration_estimated(&f->par.calibrated); k++)
        back[k] = -c->moved[k];
    plr_combine_rows(plr_covariance_dim(f), plr_calibration_estimated(&f->par.calibrated), back, 1,
                     f->S[0], PLR_MAX_LD, f->work.dx);
    plr_calibration_forget(f);
    begin_at_prior(f);
}

/* True if no number moves farther than it may; else this frame teaches nothing. */
static bool may_all_move(plr_filter *f, const plr_real *G, const plr_real *D, plr_real excess,
                         const plr_real *ds) {
    plr_calibration_estimate *c = &f->calibration;
    const plr_real *prior = f->par.calibrated.variance;
    bool may = true, refused = false;
    for (unsigned k = 0; k < plr_calibration_estimated(&f->par.calibrated); k++) {
        if (!(ds[k] * ds[k] < PLR_R(MOST_SIGMAS * MOST_SIGMAS) * prior[k]))
            return false;
        if (may_move(f, G, D, k, excess, ds[k]))
            continue;
        may = false;
        c->misfits[k]++;
        refused = refused || is_refused(f, k);
    }
    if (refused)
        put_back(f);
    return may;
}

/* A number that is refused is told nothing. */
static void leave_out_refused(plr_filter *f) {
    plr_learnt *learnt = &f->work.learnt;
    for (unsigned k = 0; k < plr_calibration_estimated(&f->par.calibrated); k++) {
        if (!is_refused(f, k))
            continue;
        learnt->eta[k] = 0;
        for (unsigned i = 0; i < K; i++)
            learnt->J[K * k + i] = learnt->J[K * i + k] = 0;
    }
}

void plr_calibration_learn(plr_filter *f) {
    plr_calibration_estimate *c = &f->calibration;
    const plr_calibrated *errors = &f->par.calibrated;
    const unsigned n = plr_calibration_estimated(errors);
    plr_real G[K * K], D[K], ds[K] = {0};
    if (n == 0 || !c->moves)
        return;
    const plr_real excess = weigh_prior(f);
    leave_out_refused(f);
    memcpy(G, c->factor, sizeof G);
    for (unsigned k = 0; k < n; k++)
        D[k] = errors->variance[k] * c->told[k] / c->excess;
    if (!correct_factor(f, G, D))
        return;
    add_product(f, G, D, f->work.learnt.eta, ds);
    if (!may_all_move(f, G, D, excess, ds))
        return;
    mislead(f, G, D);
    memcpy(c->factor, G, sizeof G);
    for (unsigned k = 0; k < n; k++)
        c->told[k] = excess * D[k] / errors->variance[k];
    c->excess = excess;
    plr_combine_rows(plr_covariance_dim(f), n, ds, 1, f->S[0], PLR_MAX_LD, f->work.dx);
    correct_camera(f, ds);
}

bool plr_calibration_is_off(const plr_filter *f) {
    for (unsigned k = 0; k < plr_calibration_estimated(&f->par.calibrated); k++)
        if (is_refused(f, k))
            return true;
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
        if (j < plr_calibration_estimated(errors) && !is_refused(f, j))
            told->estimated |= (uint16_t)(1U << errors->kind[j]);
    }
}
