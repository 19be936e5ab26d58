// SPDX-License-Identifier: MIT
#include "campaign/drive.h"

#include <math.h>
#include <string.h>

#include "campaign/poses.h"
#include "campaign/sensors.h"
#include "campaign/world.h"
#include "pelorus/pelorus.h"
#include "support/axes.h"
#include "support/exact_camera.h"

static const double BEYOND = 5; /* sigmas */

typedef struct run {
    const scenario *s;
    world world;
    sensors sensors;
    unsigned before, during, frames;
    unsigned k; /* frame, from 0 */
    plr_time_ns start_ns, frame_ns;
    plr_pose reckoned[2]; /* by the event's readings alone: as they are, less known_bias */
    double known_bias[6];
    int last_beyond; /* frame; -1: never */
    outcome *result;
} run;

static plr_filter filter; /* a megabyte: not for the stack */

static phase phase_of(const run *r, unsigned k) {
    return k < r->before ? BEFORE : k < r->before + r->during ? DURING : AFTER;
}

/* Frames of a phase in this run. */
static unsigned drive_frames(const scenario *s, unsigned parked_frames) {
    return s->is_long ? parked_frames : s->before + s->during + s->after;
}

static void begin(run *r, uint64_t seed, uint8_t scene, const drive_options *options) {
    const scenario *s = r->s;
    plr_config config;
    plr_calibration calibration;
    plr_config_default(&config);
    config.pixel_sigma_px = s->pixel_px;
    each_axis(config.velocity_sigma, s->velocity_mps);
    each_axis(config.gyro_sigma, s->gyro_radps);
    config.bias = s->bias;
    config.track_drift_px = s->told_drift;
    config.scene = scene;
    if (s->mishap != BASELINE && s->mishap != FOCAL &&
        s->mishap != ASKEW) /* the camera is exact, and P alone is judged */
        exact_camera(&config);
    if (s->slots)
        config.slots = (uint16_t)s->slots;
    world_calibration(s, &calibration);
    world_begin(&r->world, s, seed);
    sensors_begin(&r->sensors, s, &config, seed);
    (void)plr_filter_init(&filter, &calibration, &config, NULL);
    (void)plr_filter_leave_out(&filter, options->left_out);
    r->before = s->is_long ? options->parked_frames : s->before;
    r->during = s->during;
    r->frames = drive_frames(s, options->parked_frames);
    r->start_ns = UINT64_C(1000000000);
    r->frame_ns = UINT64_C(1000000000) / FRAME_HZ;
    r->last_beyond = -1;
    r->result->told_frames = r->result->again_s = r->result->first_diverged = -1;
}

/* Dead reckoning begins where the filter is. */
static void begin_reckoning(run *r) {
    double P_b[36];
    (void)plr_filter_pose(&filter, &r->reckoned[0]);
    r->reckoned[1] = r->reckoned[0];
    if (plr_filter_bias(&filter, r->known_bias, P_b) != PLR_OK)
        memset(r->known_bias, 0, sizeof r->known_bias);
}

static void reckon(run *r, const plr_twist *u) {
    for (int less_bias = 0; less_bias < 2; less_bias++) {
        double xi[6];
        for (int i = 0; i < 3; i++) {
            xi[i] = r->world.step_s * (u->v_B_mps[i] - less_bias * r->known_bias[i]);
            xi[3 + i] = r->world.step_s * (u->w_B_radps[i] - less_bias * r->known_bias[3 + i]);
        }
        r->reckoned[less_bias] = pose_moved(&r->reckoned[less_bias], xi);
    }
}

static double distance_to(const run *r, const plr_pose *pose) {
    double xi[6];
    pose_error(pose, &r->world.T_WB, xi);
    return sqrt(xi[0] * xi[0] + xi[1] * xi[1] + xi[2] * xi[2]);
}

/* Readings between two frames. Late ones come after the frame that they belong to, see
 * LATE_TWISTS; the filter may well refuse them. */
static void hear_twists(run *r, bool event) {
    const unsigned n = r->s->twists_per_frame;
    const plr_time_ns t_ns = r->start_ns + r->k * r->frame_ns;
    const bool late = event && r->s->mishap == LATE_TWISTS;
    const plr_time_ns back_ns = late ? (plr_time_ns)(r->s->strength * 1e9) : 0;
    for (unsigned i = 0; i < n; i++) {
        world_choose_twist(&r->world);
        const plr_twist u = sensors_read(&r->sensors, &r->world, event);
        if (plr_filter_predict(&filter, t_ns + i * r->frame_ns / n - back_ns, &u) != PLR_OK)
            r->result->refused++;
        if (event)
            reckon(r, &u);
        world_step(&r->world, event);
    }
}

static void judge_error(run *r, account *a, plr_health health, const plr_pose *pose,
                        const double P[36]) {
    double xi[6], worst = 0;
    pose_error(pose, &r->world.T_WB, xi);
    for (int i = 0; i < 6; i++) {
        const double sigmas = P[7 * i] > 0 ? fabs(xi[i]) / sqrt(P[7 * i]) : HUGE_VAL;
        worst = sigmas > worst || isnan(sigmas) ? sigmas : worst;
    }
    const double nees = pose_nees(xi, P);
    if (nees >= 0) {
        a->nees += nees;
        a->judged++;
    }
    const double distance = nees >= 0 ? sqrt(nees) : HUGE_VAL;
    a->sigmas = fmax(a->sigmas, isnan(worst) ? HUGE_VAL : worst);
    a->mahalanobis = fmax(a->mahalanobis, distance);
    a->error_m = sqrt(xi[0] * xi[0] + xi[1] * xi[1] + xi[2] * xi[2]);
    a->error_rad = sqrt(xi[3] * xi[3] + xi[4] * xi[4] + xi[5] * xi[5]);
    a->sigma_m = sqrt(P[0] + P[7] + P[14]);
    a->sigma_rad = sqrt(P[21] + P[28] + P[35]);
    if (!(worst <= BEYOND)) {
        a->beyond++;
        a->silent += health == PLR_HEALTH_GOOD;
        r->last_beyond = (int)r->k;
    }
    if (r->k == r->before + r->during + FRAME_HZ) {
        r->result->later_sigmas = worst;
        r->result->later_error_m = a->error_m;
        r->result->later_own_m = a->sigma_m;
    }
    if (r->k == FRAME_HZ)
        r->result->fresh_own_m = a->sigma_m;
}

static void judge_health(run *r, account *a, const plr_report *report) {
    outcome *o = r->result;
    const plr_health health = report->health;
    const unsigned end = r->before + r->during;
    a->frames++;
    a->good += health == PLR_HEALTH_GOOD;
    for (unsigned i = 0; i < REASONS && health != PLR_HEALTH_GOOD; i++)
        o->reasons[phase_of(r, r->k)][i] += (uint32_t)report->reasons >> i & 1;
    if (health != PLR_HEALTH_GOOD && r->k >= r->before && o->told_frames < 0)
        o->told_frames = r->k - r->before;
    if (r->k < end)
        return;
    if (r->last_beyond == (int)r->k || health != PLR_HEALTH_GOOD) {
        if (r->last_beyond == (int)r->k)
            o->again_s = -1;
    } else if (o->again_s < 0) {
        const unsigned true_since = r->last_beyond >= (int)end ? (unsigned)r->last_beyond + 1 : end;
        o->again_s = (double)(r->k - true_since) / FRAME_HZ;
    }
}

static void judge(run *r, const plr_report *report) {
    account *a = &r->result->phase[phase_of(r, r->k)];
    plr_pose pose;
    double P[36];
    r->result->matched += report->matched;
    r->result->gated += report->gated;
    if (plr_filter_pose(&filter, &pose) == PLR_OK &&
        plr_filter_pose_covariance(&filter, P) == PLR_OK) {
        judge_error(r, a, report->health, &pose, P);
    } else {
        a->diverged++;
        if (r->result->first_diverged < 0)
            r->result->first_diverged = r->k;
    }
    judge_health(r, a, report);
}

static void finish(run *r) {
    double b[6], P_b[36];
    plr_totals totals;
    outcome *o = r->result;
    o->has_bias = r->s->bias && plr_filter_bias(&filter, b, P_b) == PLR_OK;
    for (int i = 0; i < 6 && o->has_bias; i++)
        o->bias_sigmas[i] = (b[i] - r->sensors.bias[i]) / sqrt(P_b[7 * i]);
    if (plr_filter_totals(&filter, &totals) == PLR_OK)
        o->resets = totals.resets;
    o->done = true;
}

void drive(const scenario *s, uint64_t seed, uint8_t scene, const drive_options *options,
           outcome *result) {
    run r;
    memset(result, 0, sizeof *result);
    memset(&r, 0, sizeof r);
    r.s = s;
    r.result = result;
    begin(&r, seed, scene, options);
    for (r.k = 0; r.k < r.frames; r.k++) {
        const bool event = phase_of(&r, r.k) == DURING;
        if (r.k == r.before && r.during > 0)
            begin_reckoning(&r);
        hear_twists(&r, event);
        if (r.k == r.before && r.during > 0)
            world_strike(&r.world);
        if (r.k == r.before + r.during && r.during > 0)
            world_mend(&r.world);
        world_renew(&r.world);
        sensors_look(&r.sensors, &r.world, event);
        const plr_frame frame = {r.start_ns + (r.k + 1) * r.frame_ns, PLR_NO_BUDGET,
                                 r.sensors.count, r.sensors.seen};
        plr_report report;
        (void)plr_filter_update(&filter, &frame, &report);
        judge(&r, &report);
        if (r.k + 1 == r.before + r.during) {
            result->reckoned_m = distance_to(&r, &r.reckoned[0]);
            result->reckoned_unbiased_m = distance_to(&r, &r.reckoned[1]);
        }
    }
    finish(&r);
}
