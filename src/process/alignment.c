// SPDX-License-Identifier: MIT
#include "process/alignment.h"

#include <string.h>

#include "limits/limits.h"
#include "math/small.h"
#include "math/so3.h"
#include "process/imu_phase.h"
#include "state/blocks.h"
#include "state/covariance.h"

/* At rest this much is averaged, and after so long without rest the body counts as moving. */
#define STRETCH_NS UINT64_C(1000000000)
#define MOVING_NS  UINT64_C(3000000000)
/* A start in motion takes gravity from this much. */
#define GLANCE_NS UINT64_C(100000000)
/* After a longer pause between readings the average begins anew: few readings are no mean. */
#define PAUSE_NS UINT64_C(100000000)
/* What is known of velocity at rest, m/s: by readings that are calm, and by pictures that stand, which a body
 * that hovers hardly moves either; and of tilt at a start in motion, rad. */
#define REST_VELOCITY PLR_R(0.01)
#define SEEN_VELOCITY PLR_R(0.1)
#define TILT          PLR_R(0.2)
/* The variance of a tilt is no smaller, rad^2. */
#define VARIANCE_FLOOR PLR_R(1e-8)
/* The anchor comes this much after a start in motion, if this many frames were used. */
#define ANCHOR_NS UINT64_C(2000000000)
enum { ANCHOR_FRAMES = 10 };
/* Within this time, s, tilt and velocity are found; their product has misled position and yaw. */
#define FOUND_S PLR_R(0.5)

void plr_alignment_clear(plr_source *source) {
    memset(&source->inertial, 0, sizeof source->inertial);
    memset(&source->alignment, 0, sizeof source->alignment);
}

void plr_alignment_restart(plr_source *source) {
    const plr_alignment before = source->alignment;
    memset(&source->alignment, 0, sizeof source->alignment);
    source->alignment.first_ns = before.first_ns;
    source->alignment.seen_to_move = before.seen_to_move;
}

/* Restarts the average after a pause between readings; clears all of it if the clock was set. */
static void end_stretch(plr_source *source, plr_time_ns t_ns) {
    if (!source->reading_valid)
        memset(&source->alignment, 0, sizeof source->alignment);
    else if (t_ns - source->reading_ns > PAUSE_NS)
        plr_alignment_restart(source);
}

bool plr_alignment_is_early(const plr_alignment *at, plr_time_ns t_ns) {
    return at->count == 0 || 2 * (t_ns - at->begin_ns) <= STRETCH_NS;
}

/* Mean and spread of the readings so far (Welford). */
static void average(plr_alignment *at, plr_time_ns t_ns, const plr_real reading[PLR_POSE_DIM]) {
    if (at->first_ns == 0)
        at->first_ns = t_ns;
    if (at->count == 0)
        at->begin_ns = t_ns;
    at->count++;
    const plr_real share = PLR_R(1) / (plr_real)at->count;
    for (unsigned i = 0; i < PLR_POSE_DIM; i++) {
        const plr_real off = reading[i] - at->mean[i];
        at->mean[i] = PLR_FMA(share, off, at->mean[i]);
        plr_real *spread = &at->spread2[i / 3];
        *spread = PLR_FMA(off, reading[i] - at->mean[i], *spread);
    }
    if (plr_alignment_is_early(at, t_ns))
        memcpy(at->half_mean, at->mean, sizeof at->half_mean);
}

/* The variance of one reading: as stated, or as they scatter, if that is more. */
static plr_real variance_of(const plr_alignment *at, unsigned first, plr_real stated) {
    const plr_real shown = at->spread2[first / 3] / (PLR_R(3) * (plr_real)at->count);
    return shown > stated ? shown : stated;
}

/* True if the mean of three numbers is the same in the whole and in its first half, but for `allowed` and the
 * noise, `variance` of one reading. */
static bool is_even(const plr_source *source, unsigned first, plr_real allowed, plr_real variance) {
    const plr_alignment *at = &source->alignment;
    const plr_real share = plr_limit(source->left_out, PLR_LIMIT_DRIFT_SHARE);
    plr_real drift[3];
    for (unsigned i = 0; i < 3; i++)
        drift[i] = at->mean[first + i] - at->half_mean[first + i];
    const plr_real most =
        share * share * allowed * allowed + PLR_R(36) * variance / (plr_real)at->count;
    return plr_dot3(drift, drift) <= most;
}

/* True if three numbers scatter no more than a body's at rest; `noise`: variance of one reading. */
static bool is_steady(const plr_source *source, unsigned first, plr_real allowed, plr_real noise) {
    const plr_alignment *at = &source->alignment;
    const plr_real limit = allowed * allowed + PLR_R(4) * noise;
    return at->spread2[first / 3] <= PLR_R(3) * limit * (plr_real)at->count &&
           is_even(source, first, allowed, noise);
}

/* True if most of the points that were seen in the first half of the stretch are still where they were. */
static bool pictures_stand(const plr_alignment *at) {
    unsigned stay = 0, others = 0;
    for (unsigned i = 0; i < PLR_WATCHED_POINTS; i++)
        if (at->points[i].used & PLR_POINT_EARLY) {
            const bool stays =
                (at->points[i].used & (PLR_POINT_STAYS | PLR_POINT_MOVED)) == PLR_POINT_STAYS;
            stay += stays;
            others += !stays;
        }
    return stay >= PLR_POINTS_LEAST && stay > others;
}

/* True if the readings say by themselves that the body rests: an engine may run, no hand may walk. */
static bool is_calm(const plr_source *source, plr_real interval) {
    return is_steady(source, 0, plr_limit(source->left_out, PLR_LIMIT_SPREAD_ACCEL),
                     source->accel_density / interval) &&
           is_steady(source, 3, plr_limit(source->left_out, PLR_LIMIT_SPREAD_GYRO),
                     source->gyro_density / interval);
}

/* Whether the body rests, and what speaks against it: MOVES, or a gyro that turns meanwhile. Calm readings say
 * it alone. Motors that idle shake them more than a hand does: then it takes the pictures, and means that do
 * not wander. */
static plr_imu_fault find_unrest(const plr_source *source, plr_real interval) {
    const plr_alignment *at = &source->alignment;
    const uint64_t left_out = source->left_out;
    const plr_real spread[2] = {plr_limit(left_out, PLR_LIMIT_SPREAD_ACCEL),
                                plr_limit(left_out, PLR_LIMIT_SPREAD_GYRO)};
    const plr_real most_bias = plr_limit(left_out, PLR_LIMIT_MOST_BIAS);
    const plr_real noise[2] = {source->accel_density / interval, source->gyro_density / interval};
    const plr_real turn = plr_limit(left_out, PLR_LIMIT_TURN_SIGMAS) * source->bias_prior_sigma[3] +
                          plr_limit(left_out, PLR_LIMIT_SLOW_TURN);
    const bool still = is_steady(source, 0, spread[0], noise[0]), seen = pictures_stand(at);
    plr_real rate[3];
    for (unsigned i = 0; i < 3; i++)
        rate[i] = at->mean[3 + i] - source->bias_prior[3 + i];
    const plr_real rate2 = plr_dot3(rate, rate);
    const bool is_bias = rate2 <= turn * turn || (seen && rate2 <= most_bias * most_bias);
    if (!is_bias)
        return still || seen ? PLR_IMU_FAULT_TURNS : PLR_IMU_FAULT_MOVES;
    const bool even = is_even(source, 0, spread[0], variance_of(at, 0, noise[0])) &&
                      is_even(source, 3, spread[1], variance_of(at, 3, noise[1]));
    return is_calm(source, interval) || (seen && even) ? PLR_IMU_FAULT_NONE : PLR_IMU_FAULT_MOVES;
}

/* ---------------------------------------------------------------- the start */

/* Turns R_WB by the smallest angle that makes R_WB^T e_z = u, the measured up. */
static void tilt(plr_belief *belief, const plr_real u[3]) {
    static const plr_real half_turn[9] = {1, 0, 0, 0, -1, 0, 0, 0, -1};
    plr_real before[9], axis[3], W[9], turn[9];
    memcpy(before, belief->R_WB, sizeof before);
    if (plr_dot3(u, before + 6) < PLR_R(-0.9)) /* the formula below has no answer there */
        plr_mat3_mul(belief->R_WB, before, half_turn);
    const plr_real *up = belief->R_WB + 6; /* R_WB^T e_z, to which u is to be turned */
    plr_cross3(axis, u, up);
    const plr_real share = PLR_R(1) / (PLR_R(1) + plr_dot3(u, up));
    plr_skew(W, axis);
    plr_mat3_mul(turn, W, W);
    for (int i = 0; i < 9; i++)
        turn[i] = PLR_FMA(share, turn[i], W[i]) + (i % 4 == 0 ? PLR_R(1) : PLR_R(0));
    memcpy(before, belief->R_WB, sizeof before);
    plr_mat3_mul(belief->R_WB, before, turn);
    plr_so3_orthonormalise(belief->R_WB);
    plr_so3_orthonormalise(belief->R_WB);
}

/* X = scale (I - u u^T), 3x3: what lies across the unit vector u. */
static void across(const plr_real u[3], plr_real scale, plr_real X[9]) {
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j < 3; j++)
            X[3 * i + j] = scale * ((i == j ? PLR_R(1) : PLR_R(0)) - u[i] * u[j]);
}

/* The pose's covariance with what is known of the tilt: position and heading stay as they were set.
 * `theta` is the covariance of the tilt, 3x3, across u. */
static void set_tilt_covariance(plr_belief *belief, const plr_real u[3], const plr_real theta[9]) {
    plr_real P[PLR_POSE_SQUARE], Pu[3], heading;
    double P_xi[PLR_POSE_SQUARE] = {0};
    plr_covariance_get(belief, PLR_BLOCK_POSE, PLR_BLOCK_POSE, P);
    for (unsigned i = 0; i < 3; i++)
        Pu[i] = plr_dot3(P + PLR_POSE_DIM * (3 + i) + 3, u);
    heading = plr_dot3(Pu, u);
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j < 3; j++) {
            P_xi[PLR_POSE_DIM * i + j] = (double)P[PLR_POSE_DIM * i + j];
            P_xi[PLR_POSE_DIM * (3 + i) + 3 + j] =
                (double)(theta[3 * i + j] + heading * u[i] * u[j] +
                         (i == j ? VARIANCE_FLOOR : PLR_R(0)));
        }
    plr_covariance_begin(belief, PLR_BLOCK_POSE, P_xi);
}

static void set_velocity(plr_belief *belief, const plr_real v[3], const plr_real variance[3]) {
    double P_v[PLR_VELOCITY_DIM];
    for (unsigned i = 0; i < PLR_VELOCITY_DIM; i++) {
        belief->velocity[i] = v[i];
        P_v[i] = (double)variance[i];
    }
    plr_covariance_begin_diagonal(belief, PLR_BLOCK_VELOCITY, P_v);
}

static void set_unknown_velocity(plr_belief *belief, plr_real variance) {
    static const plr_real none[3] = {0};
    const plr_real same[3] = {variance, variance, variance};
    set_velocity(belief, none, same);
}

static void begin(plr_source *source, plr_imu_trigger how, plr_time_ns t_ns, plr_real interval) {
    plr_inertial *s = &source->inertial;
    plr_imu_phase_change(s, how);
    s->started_ns = s->still_ns = t_ns;
    source->bias_walked_s = 0; /* the biases begin with their prior's variances */
    s->usual_s = interval;
    memcpy(s->slow, source->alignment.mean, sizeof s->slow);
    memset(&source->alignment, 0, sizeof source->alignment); /* as after a restore */
}

/* The unit vector of a mean specific force less its bias; returns its length, m/s^2. */
static plr_real measured_up(const plr_belief *belief, const plr_real mean[3], plr_real u[3]) {
    for (unsigned i = 0; i < 3; i++)
        u[i] = mean[i] - belief->bias[i];
    const plr_real length = PLR_SQRT(plr_dot3(u, u));
    for (unsigned i = 0; i < 3 && length > 0; i++)
        u[i] /= length;
    return length;
}

/* Within these a mean specific force is taken for gravity's. */
typedef struct gravity_limits {
    plr_real least, most; /* its length, m/s^2 */
    plr_real least_up;    /* the cosine of its angle to the pose's up; ANY_TILT: no limit */
} gravity_limits;

#define ANY_LENGTH PLR_R(1e9)
#define ANY_TILT   PLR_R(-2)

/* What speaks against this mean specific force, if anything; in_pose: its direction tells. */
static plr_imu_fault find_fault(const plr_belief *belief, const plr_source *source,
                                const plr_real u[3], plr_real length, const gravity_limits *fits,
                                bool in_pose) {
    const uint64_t left_out = source->left_out;
    const plr_real g = source->gravity, up = plr_dot3(u, belief->R_WB + 6);
    if (length < plr_limit(left_out, PLR_LIMIT_IN_G_BELOW) * g &&
        length > plr_limit(left_out, PLR_LIMIT_FALLS_BELOW) * g)
        return PLR_IMU_FAULT_IN_G;
    if (length < fits->least || length > fits->most)
        return PLR_IMU_FAULT_NOT_GRAVITY;
    if (in_pose && up < plr_limit(left_out, PLR_LIMIT_UPSIDE_DOWN))
        return PLR_IMU_FAULT_UPSIDE_DOWN;
    return in_pose && up < fits->least_up ? PLR_IMU_FAULT_TILT : PLR_IMU_FAULT_NONE;
}

/* At rest: the mean rate is the gyro's bias, and the mean specific force points up, but for the
 * accelerometer's bias: theta = [u]x db_a / g. */
static void start_at_rest(plr_belief *belief, plr_source *source, plr_time_ns t_ns,
                          plr_real interval, const plr_real u[3]) {
    enum { A = 0, G = 3 };
    const plr_alignment *at = &source->alignment;
    const plr_real readings = (plr_real)at->count, g2 = source->gravity * source->gravity;
    const plr_real slow_turn = plr_limit(source->left_out, PLR_LIMIT_SLOW_TURN);
    const bool calm = is_calm(source, interval); /* else the pictures have said that it rests */
    const plr_real speed = calm ? REST_VELOCITY : SEEN_VELOCITY;
    const plr_real measured = variance_of(at, 3, source->gyro_density / interval) / readings +
                              (calm ? PLR_R(0) : slow_turn * slow_turn);
    const plr_real flicker = variance_of(at, 0, source->accel_density / interval) / (readings * g2);
    plr_real L[9], theta[9], cross[PLR_POSE_DIM * PLR_BIAS_DIM] = {0};
    double variance[PLR_BIAS_DIM];
    for (unsigned i = 0; i < PLR_BIAS_DIM; i++)
        variance[i] = (double)source->bias_prior_sigma[i] * (double)source->bias_prior_sigma[i];
    for (unsigned i = G; i < PLR_BIAS_DIM; i++) {
        const double off = (double)(at->mean[i] - source->bias_prior[i]);
        const bool agrees = off * off <= 9 * (variance[i] + (double)measured);
        if (variance[i] <= (double)measured && agrees)
            continue;
        belief->bias[i] = source->bias_prior[i] = at->mean[i];
        source->bias_prior_sigma[i] = PLR_SQRT(measured);
        variance[i] = (double)measured;
    }
    plr_skew(L, u);
    for (unsigned i = 0; i < 9; i++)
        L[i] /= source->gravity;
    across(u, flicker, theta);
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j < 3; j++) {
            for (unsigned k = 0; k < 3; k++)
                theta[3 * i + j] += L[3 * i + k] * L[3 * j + k] * (plr_real)variance[A + k];
            cross[PLR_POSE_DIM * (A + j) + 3 + i] = L[3 * i + j] * (plr_real)variance[A + j];
        }
    tilt(belief, u);
    plr_covariance_begin_diagonal(belief, PLR_BLOCK_BIAS, variance);
    set_unknown_velocity(belief, speed * speed);
    set_tilt_covariance(belief, u, theta);
    plr_covariance_set(belief, PLR_BLOCK_BIAS, PLR_BLOCK_POSE, cross);
    begin(source, PLR_IMU_STARTS_AT_REST, t_ns, interval);
}

/* In motion: the tilt from a moment's mean, with a velocity that the first frames will find. */
static void start_in_motion(plr_belief *belief, plr_source *source, plr_time_ns t_ns,
                            plr_real interval, const plr_real u[3]) {
    plr_real theta[9];
    across(u, TILT * TILT, theta);
    tilt(belief, u);
    set_unknown_velocity(belief, source->start_velocity_variance);
    set_tilt_covariance(belief, u, theta);
    begin(source, PLR_IMU_STARTS_MOVING, t_ns, interval);
}

void plr_alignment_given(plr_belief *belief, plr_source *source, const plr_real v[PLR_VELOCITY_DIM],
                         const plr_real variance[PLR_VELOCITY_DIM]) {
    set_velocity(belief, v, variance);
    begin(source, PLR_IMU_STARTS_AS_TOLD, belief->t_ns, 0);
}

void plr_alignment_does_not_stand(plr_source *source, plr_imu_fault how) {
    if (source->inertial.fault != PLR_IMU_FAULT_TURNS)
        source->inertial.fault = (uint8_t)how;
}

/* Starts if the stretch that was averaged is good for it. */
static bool try_to_start(plr_belief *belief, plr_source *source, plr_time_ns t_ns, bool at_rest) {
    plr_alignment *at = &source->alignment;
    plr_real u[3];
    const plr_real interval =
        (plr_real)((double)(t_ns - at->begin_ns) * 1e-9 / (double)(at->count - 1));
    const plr_real length = measured_up(belief, at->mean, u);
    const plr_imu_fault unrest = at_rest ? find_unrest(source, interval) : PLR_IMU_FAULT_NONE;
    if (unrest != PLR_IMU_FAULT_NONE) {
        plr_alignment_does_not_stand(source, unrest);
        return false;
    }
    const plr_real g = source->gravity;
    const plr_real off = plr_limit(source->left_out, PLR_LIMIT_NOT_GRAVITY);
    const plr_real other_tilt = plr_limit(source->left_out, PLR_LIMIT_OTHER_TILT);
    const gravity_limits resting = {g - off, g + off, PLR_R(1) - other_tilt};
    const gravity_limits moving = {0, ANY_LENGTH, ANY_TILT};
    source->inertial.fault = (uint8_t)find_fault(
        belief, source, u, length, at_rest ? &resting : &moving, source->inertial.pose_given);
    if (source->inertial.fault != PLR_IMU_FAULT_NONE &&
        source->inertial.fault != PLR_IMU_FAULT_TILT)
        return false;
    if (at_rest)
        start_at_rest(belief, source, t_ns, interval, u);
    else
        start_in_motion(belief, source, t_ns, interval, u);
    return true;
}

/* What may start it, by the setting `imu-start`. Where both may, motion waits until a rest has not come. */
typedef struct start_way {
    bool at_rest, in_motion;
    bool as_told; /* by the pose that was set, whatever the readings say */
} start_way;

static const start_way ways[] = {
    [PLR_IMU_START_AUTO] = {.at_rest = true, .in_motion = true},
    [PLR_IMU_START_REST] = {.at_rest = true},
    [PLR_IMU_START_MOTION] = {.in_motion = true},
    [PLR_IMU_START_GIVEN] = {.as_told = true},
};

void plr_alignment_add(plr_belief *belief, plr_source *source, const plr_config *config,
                       plr_time_ns t_ns, const plr_real reading[PLR_POSE_DIM]) {
    const start_way *way = &ways[config->imu_start];
    plr_alignment *at = &source->alignment;
    if (way->as_told) {
        if (source->inertial.pose_given) {
            set_unknown_velocity(belief, source->start_velocity_variance);
            begin(source, PLR_IMU_STARTS_MOVING, t_ns, 0);
        }
        return;
    }
    end_stretch(source, t_ns);
    average(at, t_ns, reading);
    const plr_time_ns stretch = t_ns - at->begin_ns;
    const plr_time_ns wait = at->seen_to_move ? STRETCH_NS : MOVING_NS;
    const bool may_move = way->in_motion && (!way->at_rest || t_ns - at->first_ns >= wait);
    bool started = false;
    if (stretch >= STRETCH_NS && way->at_rest)
        started = try_to_start(belief, source, t_ns, true);
    const bool doubtful =
        source->inertial.fault == PLR_IMU_FAULT_TURNS; /* the gyro is wrong, or soon rests */
    if (!started && may_move && !doubtful && stretch >= GLANCE_NS && at->count > 1)
        started = try_to_start(belief, source, t_ns, false);
    if (!started && stretch >= STRETCH_NS)
        plr_alignment_restart(source);
}

/* What speaks against the readings' mean of half a second, whatever the body does meanwhile. */
static plr_imu_fault find_doubt(const plr_belief *belief, const plr_source *source) {
    const uint64_t left_out = source->left_out;
    const plr_real g = source->gravity, *rate = source->inertial.slow + 3;
    const plr_real spins = plr_limit(left_out, PLR_LIMIT_SPINS);
    plr_real u[3];
    const plr_real length = measured_up(belief, source->inertial.slow, u);
    const bool carried = length > plr_limit(left_out, PLR_LIMIT_CARRIED_LEAST) * g &&
                         length < plr_limit(left_out, PLR_LIMIT_CARRIED_MOST) * g;
    if (carried && plr_dot3(rate, rate) > spins * spins)
        return PLR_IMU_FAULT_TURNS;
    if (length <= plr_limit(left_out, PLR_LIMIT_FALLS_BELOW) * g)
        return PLR_IMU_FAULT_NONE;
    const gravity_limits fits = {plr_limit(left_out, PLR_LIMIT_DOUBT_LEAST) * g,
                                 plr_limit(left_out, PLR_LIMIT_DOUBT_MOST) * g,
                                 carried ? plr_limit(left_out, PLR_LIMIT_DOUBT_UP) : ANY_TILT};
    return find_fault(belief, source, u, length, &fits, true);
}

void plr_alignment_watch_gravity(const plr_belief *belief, plr_source *source) {
    const uint64_t left_out = source->left_out;
    const unsigned frames = plr_limit_count(left_out, PLR_LIMIT_WATCH_FRAMES);
    plr_inertial *s = &source->inertial;
    const bool watches = s->fault == PLR_IMU_FAULT_NONE &&
                         belief->t_ns - s->started_ns <= plr_limit_ns(left_out, PLR_LIMIT_WATCH_MS);
    const bool doubts = s->fault > PLR_IMU_FAULT_NONE && s->fault < PLR_IMU_FAULT_TILT;
    if (s->phase < PLR_IMU_UNSETTLED || !(watches || doubts))
        return;
    const plr_imu_fault doubt = find_doubt(belief, source);
    if ((doubt != PLR_IMU_FAULT_NONE) == doubts)
        s->doubts = 0; /* nothing new */
    else if (s->doubts++ == 0)
        s->doubted_ns = belief->t_ns;
    if (s->doubts >= frames &&
        belief->t_ns - s->doubted_ns >= plr_limit_ns(left_out, PLR_LIMIT_DOUBT_MS)) {
        s->fault = (uint8_t)doubt;
        s->doubts = 0;
    } else if (s->doubts > frames) {
        s->doubts = (uint8_t)frames; /* more are not counted */
    }
}

/* ---------------------------------------------------------------- the anchor */

bool plr_alignment_is_unsettled(const plr_source *source) {
    return source->inertial.phase == PLR_IMU_UNSETTLED ||
           source->inertial.phase == PLR_IMU_UNSETTLED_IN_WORLD;
}

void plr_alignment_follow_clock(const plr_belief *belief, plr_source *source, plr_time_ns t_ns) {
    if (source->inertial.phase < PLR_IMU_UNSETTLED)
        return;
    source->inertial.started_ns +=
        t_ns - belief->t_ns; /* unsigned: a time before zero wraps, and back */
    source->inertial.still_ns += t_ns - belief->t_ns;
}

void plr_alignment_keep_world(plr_source *source) {
    if (source->process == PLR_PROCESS_IMU)
        plr_imu_phase_change(&source->inertial, PLR_IMU_WORLD_GIVEN);
}

/* Adds variances of the position, in each direction, and of the yaw, about the vertical u. */
static void add_to_pose(plr_belief *belief, const plr_real u[3], plr_real position, plr_real yaw) {
    plr_real C[PLR_POSE_SQUARE] = {0};
    for (unsigned i = 0; i < 3; i++) {
        C[(PLR_POSE_DIM + 1) * i] = position;
        for (unsigned j = 0; j < 3; j++)
            C[PLR_POSE_DIM * (3 + i) + 3 + j] = yaw * (u[i] * u[j]);
    }
    plr_covariance_add(belief, PLR_BLOCK_POSE, C);
}

/* Removes what is known of position and yaw, and their shares in all else. */
static void forget_place(plr_belief *belief, const plr_real u[3]) {
    plr_real A[PLR_POSE_SQUARE] = {0}, stays[9];
    across(u, 1, stays);
    for (unsigned i = 0; i < 3; i++)
        memcpy(A + PLR_POSE_DIM * (3 + i) + 3, stays + 3 * i, 3 * sizeof *A);
    plr_covariance_turn_pose(belief, A);
}

void plr_alignment_anchor(plr_belief *belief, const plr_motion *motion, plr_source *source,
                          const plr_config *config) {
    const plr_inertial *s = &source->inertial;
    const plr_real variance = (plr_real)(config->start_sigma * config->start_sigma);
    const plr_real *u = belief->R_WB + 6; /* R_WB^T e_z */
    if (!plr_alignment_is_unsettled(source) || s->frames < ANCHOR_FRAMES ||
        belief->t_ns - s->started_ns < ANCHOR_NS || motion->pending)
        return;
    if (s->phase == PLR_IMU_UNSETTLED_IN_WORLD) {
        const plr_real way2 = source->start_velocity_variance * (FOUND_S * FOUND_S);
        add_to_pose(belief, u, TILT * TILT * way2, TILT * TILT * (TILT * TILT));
    } else {
        forget_place(belief, u);
        add_to_pose(belief, u, variance, variance);
    }
    plr_imu_phase_change(&source->inertial, PLR_IMU_ANCHORS);
}
