// SPDX-License-Identifier: MIT
#include "session/reanchor.h"

#include <string.h>

#include "pelorus/assertions.h"
#include "session/line.h"
#include "session/send.h"

/* The most that is ever claimed not to be known. */
#define MAX_POSITION_VARIANCE 1e6                /* (1 km)^2 */
#define MAX_ANGLE_VARIANCE    3.2898681336964528 /* pi^2 / 3 */
/* A body with an IMU may turn like this at any time, rad/s. */
#define USUAL_RATE 1.0

static plr_time_ns distance_ns(plr_time_ns a, plr_time_ns b) {
    return a > b ? a - b : b - a;
}

bool plr_clock_watch_note(plr_clock_watch *watch, plr_time_ns t_ns, plr_status status,
                          plr_time_ns filter_ns, plr_time_ns max_gap_ns) {
    if (status == PLR_OK || status == PLR_E_DIVERGED) {
        watch->agreeing = 0;
        return false;
    }
    if (status != PLR_E_TIME && status != PLR_E_LATE && status != PLR_E_GAP)
        return false; /* says nothing about the clock */
    if (distance_ns(t_ns, filter_ns) <= max_gap_ns)
        return false;
    if (watch->agreeing > 0 && t_ns == watch->last_ns)
        return false;
    const bool agrees = t_ns > watch->last_ns && t_ns - watch->last_ns <= max_gap_ns;
    watch->agreeing = watch->agreeing > 0 && agrees ? watch->agreeing + 1u : 1u;
    watch->last_ns = t_ns;
    PLR_ASSERT(watch->agreeing <= PLR_SESSION_AGREEING);
    if (watch->agreeing < PLR_SESSION_AGREEING)
        return false;
    watch->agreeing = 0;
    return true;
}

/* |x_1| + |x_2| + |x_3|: never less than the norm. */
static double sum3(const double x[3]) {
    double sum = 0;
    for (unsigned i = 0; i < 3; i++)
        sum += x[i] < 0 ? -x[i] : x[i];
    return sum;
}

static double largest3(const double x[3]) {
    const double pair = x[0] > x[1] ? x[0] : x[1];
    return pair > x[2] ? pair : x[2];
}

/* Adds to the covariance of a pose that it moved by `way` and turned by `turn`, one sigma. */
static void widen(double P[36], double way, double turn) {
    const double position = way * way, angle = turn * turn;
    PLR_ASSERT(way >= 0 && turn >= 0);
    for (unsigned i = 0; i < 3; i++) {
        P[7 * i] += position < MAX_POSITION_VARIANCE ? position : MAX_POSITION_VARIANCE;
        P[7 * (i + 3)] += angle < MAX_ANGLE_VARIANCE ? angle : MAX_ANGLE_VARIANCE;
    }
}

/* The covariance of the last pose after a gap of so many seconds. */
static plr_status covariance_after(double P[36], const plr_filter *f, double seconds) {
    const plr_config *config = plr_filter_config(f);
    double beside_v = 0, beside_w = 0;
    plr_twist u;
    if (config->process == PLR_PROCESS_IMU) {
        beside_v = config->start_velocity_sigma_mps;
        beside_w = USUAL_RATE;
    } else if (config->noise == PLR_NOISE_TWIST) {
        beside_v = largest3(config->velocity_sigma);
        beside_w = largest3(config->gyro_sigma);
    }
    if (plr_filter_velocity(f, &u) != PLR_OK || plr_filter_pose_covariance(f, P) != PLR_OK)
        return PLR_E_NOT_READY;
    const double speed = sum3(u.v_B_mps) + beside_v;
    const double rate = sum3(u.w_B_radps) + beside_w;
    widen(P, speed * seconds, rate * seconds);
    return PLR_OK;
}

/* Units of the counters of 32 bits that senders count in. */
static const struct {
    uint64_t ns;
    const char *name;
} counters[] = {{1, "nanoseconds"}, {1000, "microseconds"}, {1000000, "milliseconds"}};
#define COUNTERS (sizeof counters / sizeof *counters)
#define NEAR_NS  UINT64_C(1000000000)

/* The counter that goes round from `from_ns` to `to_ns`, or COUNTERS; `left_ns` went by then. */
static unsigned counter_that_wraps(plr_time_ns from_ns, plr_time_ns to_ns, plr_time_ns *left_ns) {
    for (unsigned i = 0; i < COUNTERS; i++) {
        *left_ns =
            from_ns > to_ns ? distance_ns(from_ns - to_ns, counters[i].ns << 32) : UINT64_MAX;
        if (*left_ns <= NEAR_NS)
            return i;
    }
    return COUNTERS;
}

void plr_reanchor_tell_counter(plr_text *line, plr_time_ns from_ns, plr_time_ns to_ns) {
    plr_time_ns left_ns;
    const unsigned i = counter_that_wraps(from_ns, to_ns, &left_ns);
    if (i == COUNTERS)
        return;
    plr_line_text(line, ". So do 32-bit ");
    plr_line_text(line, counters[i].name);
    plr_line_text(line, " that wrap: count in 64 bits");
}

/* The time that went by, as far as a clock that jumped tells it: where a counter went round what
 * is left of its round, else all that it jumped. Four seconds, the round of nanoseconds, may be
 * chance; 71 minutes to a second are none. */
static double gone_by_s(plr_time_ns from_ns, plr_time_ns to_ns) {
    plr_time_ns left_ns;
    const unsigned i = counter_that_wraps(from_ns, to_ns, &left_ns);
    return (double)(i > 0 && i < COUNTERS ? left_ns : distance_ns(from_ns, to_ns)) * 1e-9;
}

static void report(plr_session *s, plr_time_ns from_ns, plr_time_ns to_ns) {
    plr_text *line = &s->out.as.text;
    plr_line_begin(line, PLR_SEVERITY_WARNING, "the clock jumped from ");
    plr_line_time(line, from_ns);
    plr_line_text(line, " to ");
    plr_line_time(line, to_ns);
    plr_line_text(line, ", further than max-gap; three messages agree, so it is followed: "
                        "landmarks leave, the pose stays with a wider covariance");
    plr_reanchor_tell_counter(line, from_ns, to_ns);
    plr_send_text(s);
}

static plr_status set_pose(plr_filter *f, plr_time_ns t_ns, const plr_pose *pose, double P[36]) {
    const plr_status status = plr_filter_set_pose(f, t_ns, pose, P);
    if (status != PLR_E_ARGUMENT)
        return status;
    memset(P, 0, 36 * sizeof *P); /* it was not positive even before: nothing is known */
    widen(P, 1e30, 1e30);
    return plr_filter_set_pose(f, t_ns, pose, P);
}

/* As after init, but for the biases. */
static plr_status start_anew(plr_filter *f) {
    double bias[6], P_b[36], variance[6];
    plr_status status = plr_filter_bias(f, bias, P_b);
    if (status == PLR_OK)
        status = plr_filter_reset(f);
    if (status != PLR_OK)
        return status;
    for (unsigned i = 0; i < 6; i++)
        variance[i] = P_b[7 * i];
    (void)plr_filter_set_bias(f, bias, variance); /* not those of a filter that diverged */
    return PLR_OK;
}

/* With an IMU tilt and velocity are lost too: the filter starts anew, with the last place and
 * heading, and with the biases that it knows. A controller sees the jump in reset_count. */
static plr_status carry_pose(plr_session *s, plr_time_ns t_ns, double seconds) {
    plr_filter *f = &s->filter;
    const bool inertial = plr_filter_config(f)->process == PLR_PROCESS_IMU;
    const uint32_t resets = plr_send_resets(s);
    plr_pose pose;
    double P[36];
    plr_status status = plr_filter_pose(f, &pose);
    if (status == PLR_OK)
        status = covariance_after(P, f, seconds);
    if (status == PLR_OK && inertial)
        status = start_anew(f);
    if (status == PLR_OK)
        status = set_pose(f, t_ns, &pose, P);
    if (status == PLR_OK && inertial)
        plr_send_resets_become(s, resets + 1);
    return status;
}

static plr_status reanchor(plr_session *s, plr_time_ns t_ns) {
    plr_filter *f = &s->filter;
    const plr_time_ns from_ns = plr_filter_time(f);
    (void)plr_filter_flush_map(f); /* the session's sink accepts all */
    const plr_status status = plr_filter_config(f)->mode == PLR_MODE_MAPPING
                                  ? plr_filter_reset(f)
                                  : carry_pose(s, t_ns, gone_by_s(from_ns, t_ns));
    if (status == PLR_OK) {
        s->totals.reanchored++;
        report(s, from_ns, t_ns);
    }
    return status;
}

plr_time_ns plr_clock_max_gap_ns(const plr_session *s) {
    return (plr_time_ns)(plr_filter_config(&s->filter)->max_gap_s * 1e9 + 0.5);
}

bool plr_clock_was_set_back(const plr_session *s, plr_time_ns newest_ns, plr_time_ns t_ns) {
    return t_ns < newest_ns && newest_ns - t_ns > plr_clock_max_gap_ns(s);
}

bool plr_reanchor_follow(plr_session *s, plr_time_ns t_ns, plr_status status) {
    return plr_clock_watch_note(&s->watch, t_ns, status, plr_filter_time(&s->filter),
                                plr_clock_max_gap_ns(s)) &&
           reanchor(s, t_ns) == PLR_OK;
}
