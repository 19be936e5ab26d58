// SPDX-License-Identifier: MIT
/* What residuals teach of the calibration: the second stage of Friedland's filter. */
#include "state/calibration.h"

#include <string.h>

#include "math/dense.h"
#include "math/finite.h"
#include "math/small.h"
#include "pelorus/assertions.h"
#include "state/blocks.h"

enum {
    K = PLR_CALIBRATIONS,
    MOST_SIGMAS = 5,  /* of the prior, in one correction: more is no calibration */
    LEARNT_SIGMAS = 4 /* by which a number may have moved, of what is learnt of it */
};

/* What a frame says of the calibration is added up over some 32 frames, seconds of a camera: slow errors
 * of the odometry last as long. */
#define KEPT (PLR_R(1) - PLR_R(1) / PLR_R(32))
/* Added to the variance of that sum, in sigmas of the prior: what is told less of is no evidence. */
#define LITTLE PLR_R(1e-4)

void plr_calibration_begin(const plr_camera_model *camera, plr_learnt *learnt) {
    if (plr_calibration_estimated(&camera->errors) > 0)
        memset(learnt, 0, sizeof *learnt);
}

void plr_calibration_marginalise(const plr_camera_model *camera, plr_workspace *work) {
    plr_learnt *to = &work->learnt;
    const plr_noise *noise = &work->noise;
    for (unsigned k = 0; k < plr_calibration_estimated(&camera->errors); k++)
        for (unsigned i = 0; i < PLR_POSE_DIM; i++) {
            const plr_real by = noise->eta_of_S[k][i];
            to->eta[k] = PLR_FMA(by, noise->eta[i], to->eta[k]);
            for (unsigned l = k; l < camera->errors.count; l++)
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
static void times_learnt(const plr_camera_model *camera, const plr_learnt *learnt, unsigned size,
                         const plr_real *x, plr_real *y) {
    const plr_real *J = learnt->J; /* an upper triangle */
    for (unsigned i = 0; i < plr_calibration_estimated(&camera->errors); i++) {
        y[i] = 0;
        for (unsigned j = 0; j < size; j++)
            y[i] = PLR_FMA(i < j ? J[K * i + j] : J[K * j + i], x[j], y[i]);
    }
}

/* Sigma = G D G^T, row k of G the column of error k, once J is known of the estimated. The columns are
 * conjugate, g_i^T Sigma^-1 g_k = 0, and of each is taken off what makes it so by Sigma^-1 + J; 1 / D_k is what
 * that gives of g_k itself. So nothing is ever inverted, and float32 will do: it is a square root filter
 * (Bierman, Factorization Methods for Discrete Sequential Estimation, 1977). False if J is none. */
static bool correct_factor(const plr_camera_model *camera, const plr_learnt *learnt, plr_real *G,
                           plr_real *D) {
    for (unsigned k = 0; k < plr_calibration_estimated(&camera->errors); k++) {
        plr_real *g = G + K * k, Jg[K];
        times_learnt(camera, learnt, k + 1, g, Jg);
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
static void add_product(const plr_camera_model *camera, const plr_real *G, const plr_real *D,
                        const plr_real *y, plr_real *x) {
    PLR_ASSERT(camera->errors.estimated <= camera->errors.count);
    for (unsigned k = 0; k < plr_calibration_estimated(&camera->errors); k++)
        add(k + 1, D[k] * dot(k + 1, G + K * k, y), G + K * k, x);
}

bool plr_calibration_is_sound(const plr_camera_model *camera) {
    for (unsigned k = 0; k < plr_calibration_estimated(&camera->errors); k++)
        if (!(camera->estimate.told[k] > 0))
            return false;
    return true;
}

/* The variance of what a frame says of error k beside its estimate, were all errors white, in sigmas of the
 * prior: J + J Sigma J. */
static plr_real score_variance(const plr_camera_model *camera, const plr_learnt *learnt,
                               unsigned k) {
    const plr_camera_estimate *c = &camera->estimate;
    const plr_real *J = learnt->J;
    plr_real sum = J[(K + 1) * k];
    for (unsigned m = 0; m < plr_calibration_estimated(&camera->errors); m++) {
        plr_real by = 0;
        for (unsigned j = 0; j <= m; j++)
            by = PLR_FMA(c->factor[K * m + j], j < k ? J[K * j + k] : J[K * k + j], by);
        sum = PLR_FMA(camera->errors.variance[m] * c->told[m] * by, by, sum);
    }
    return camera->errors.variance[k] * sum;
}

/* How much more the scores g of several frames add up to than those of one suggest. Errors that are alike
 * from frame to frame do not average out, and the information of the residuals, taken for white, is
 * that much too large: an overdispersion (McCullagh and Nelder, Generalized Linear Models, 1989, 4.5), of
 * a sum because of the correlation. */
static plr_real note_excess(plr_camera_model *camera, const plr_learnt *learnt) {
    plr_camera_estimate *c = &camera->estimate;
    plr_real largest = 1;
    c->usual_frames += 1;
    for (unsigned k = 0; k < plr_calibration_estimated(&camera->errors); k++) {
        const plr_real sigma = PLR_SQRT(camera->errors.variance[k]);
        c->sum[k] = PLR_FMA(KEPT, c->sum[k], sigma * learnt->eta[k]);
        c->sum_variance[k] =
            PLR_FMA(KEPT * KEPT, c->sum_variance[k], score_variance(camera, learnt, k));
        const plr_real ratio = c->sum[k] * c->sum[k] / (c->sum_variance[k] + LITTLE);
        c->usual[k] += (ratio - c->usual[k]) / c->usual_frames;
        if (c->usual[k] > largest)
            largest = c->usual[k];
    }
    return largest;
}

/* What is learnt counts 1/excess of what it says, that of all frames so far too: so as the excess grows,
 * prior and what it was drawn to gain weight beside it. */
static plr_real weigh_prior(const plr_belief *belief, plr_camera_model *camera,
                            plr_learnt *learnt) {
    plr_camera_estimate *c = &camera->estimate;
    const plr_real excess =
        plr_has_block(belief, PLR_BLOCK_VELOCITY) ? c->excess : note_excess(camera, learnt);
    for (unsigned k = 0; k < plr_calibration_estimated(&camera->errors); k++) {
        const plr_real more = (excess - c->excess) / camera->errors.variance[k];
        learnt->J[(K + 1) * k] += more;
        learnt->eta[k] = PLR_FMA(-more, c->moved[k], learnt->eta[k]);
    }
    return excess;
}

/* How each error that is considered misleads those that are estimated: -Sigma times the information that
 * they share. */
static void mislead(const plr_camera_model *camera, const plr_learnt *learnt, plr_real *G,
                    const plr_real *D) {
    const unsigned n = plr_calibration_estimated(&camera->errors);
    for (unsigned k = n; k < camera->errors.count; k++) {
        plr_real less[K];
        times_learnt(camera, learnt, n, G + K * k, less);
        for (unsigned i = 0; i < n; i++)
            less[i] = -(less[i] + learnt->J[K * i + k]);
        add_product(camera, G, D, less, G + K * k);
    }
}

/* The variance of error j, of the columns G and D of a factor. */
static plr_real variance_of(const plr_camera_model *camera, const plr_real *G, const plr_real *D,
                            unsigned j) {
    plr_real variance = 0;
    for (unsigned k = j; k < plr_calibration_estimated(&camera->errors); k++)
        variance = PLR_FMA(G[K * k + j] * G[K * k + j], D[k], variance);
    return variance;
}

/* What is learnt of a number moves it from its prior's mean by N(0, P_0 - P), with P_0 the variance of its prior and P
 * what is left: no farther than that information lets it. Else it is no calibration that the residuals show. */
static bool may_move(const plr_camera_model *camera, const plr_real *G, const plr_real *D,
                     unsigned k, plr_real excess, plr_real ds) {
    const plr_real prior = camera->errors.variance[k];
    const plr_real learnt = prior - excess * variance_of(camera, G, D, k);
    const plr_real moved = camera->estimate.moved[k] + ds;
    return moved * moved <= PLR_R(LEARNT_SIGMAS * LEARNT_SIGMAS) * (learnt + LITTLE * prior);
}

/* The state and the camera as if nothing had been learnt: what was moved is no error of the calibration. A number
 * that is refused is considered from now on, and the others are learnt anew. */
static void put_back(const plr_belief *belief, plr_camera_model *camera, plr_real *dx) {
    plr_camera_estimate *c = &camera->estimate;
    plr_real back[K];
    for (unsigned k = 0; k < plr_calibration_estimated(&camera->errors); k++)
        back[k] = -c->moved[k];
    plr_combine_rows(plr_covariance_dim(belief), plr_calibration_estimated(&camera->errors), back,
                     1, belief->S[0], PLR_MAX_LD, dx);
    plr_calibration_forget(camera);
    plr_calibration_put_back(camera);
}

/* True if no number moves farther than it may; else this frame teaches nothing. */
static bool may_all_move(const plr_belief *belief, plr_camera_model *camera, plr_real *dx,
                         const plr_real *G, const plr_real *D, plr_real excess,
                         const plr_real *ds) {
    plr_camera_estimate *c = &camera->estimate;
    const plr_real *prior = camera->errors.variance;
    bool may = true, refused = false;
    for (unsigned k = 0; k < plr_calibration_estimated(&camera->errors); k++) {
        if (!(ds[k] * ds[k] < PLR_R(MOST_SIGMAS * MOST_SIGMAS) * prior[k]))
            return false;
        if (may_move(camera, G, D, k, excess, ds[k]))
            continue;
        may = false;
        c->misfits[k]++;
        refused = refused || plr_calibration_refuses(camera, k);
    }
    if (refused)
        put_back(belief, camera, dx);
    return may;
}

/* A number that is refused is told nothing. */
static void leave_out_refused(const plr_camera_model *camera, plr_learnt *learnt) {
    for (unsigned k = 0; k < plr_calibration_estimated(&camera->errors); k++) {
        if (!plr_calibration_refuses(camera, k))
            continue;
        learnt->eta[k] = 0;
        for (unsigned i = 0; i < K; i++)
            learnt->J[K * k + i] = learnt->J[K * i + k] = 0;
    }
}

void plr_calibration_learn(const plr_belief *belief, plr_camera_model *camera,
                           plr_workspace *work) {
    PLR_ASSERT(camera->errors.count == belief->layout.errors);
    plr_camera_estimate *c = &camera->estimate;
    const plr_error_columns *errors = &camera->errors;
    const unsigned n = plr_calibration_estimated(errors);
    plr_real G[K * K], D[K], ds[K] = {0};
    if (n == 0 || !c->moves)
        return;
    const plr_real excess = weigh_prior(belief, camera, &work->learnt);
    leave_out_refused(camera, &work->learnt);
    memcpy(G, c->factor, sizeof G);
    for (unsigned k = 0; k < n; k++)
        D[k] = errors->variance[k] * c->told[k] / c->excess;
    if (!correct_factor(camera, &work->learnt, G, D))
        return;
    add_product(camera, G, D, work->learnt.eta, ds);
    if (!may_all_move(belief, camera, work->dx, G, D, excess, ds))
        return;
    mislead(camera, &work->learnt, G, D);
    memcpy(c->factor, G, sizeof G);
    for (unsigned k = 0; k < n; k++)
        c->told[k] = excess * D[k] / errors->variance[k];
    c->excess = excess;
    plr_combine_rows(plr_covariance_dim(belief), n, ds, 1, belief->S[0], PLR_MAX_LD, work->dx);
    plr_calibration_correct(camera, ds);
}
