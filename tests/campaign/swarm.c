// SPDX-License-Identifier: MIT
#include "campaign/swarm.h"

#include <math.h>
#include <string.h>

#include "campaign/chance.h"
#include "campaign/poses.h"
#include "pelorus/pelorus.h"
#include "support/exact_camera.h"

static const double PI = 3.14159265358979323846, GRAVITY = 9.81, NEAR_M = 1.5;
static const double REST_S = 2.5; /* before each blow, and after the last one */
static const double BEYOND = 5;   /* sigmas */
static const plr_time_ns START_NS = 1000000000;

enum { WIDTH_PX = 640, HEIGHT_PX = 480, MOST_POINTS = 60, BLOWS = 5, MOST_LEAD_NS = 1000 };

typedef struct blow {
    double from_s, lasts_s, a_mps2[3], w_radps[3];
} blow;

typedef struct body {
    swarm_drive is;
    plr_calibration calibration;
    blow blows[BLOWS];
    double bias[6];
    double point_m[MOST_POINTS][3];
    uint32_t id[MOST_POINTS], next_id;
    chance motion, noise, scene;
} body;

/* Where the errors stand between one blow and the next. */
typedef struct judge {
    unsigned blow; /* that has begun last, from 1; 0: none yet */
    bool good_again, left;
    double before_m[3], error_m[3];
} judge;

static plr_filter filter; /* a megabyte: not for the stack */

/* ---------------------------------------------------------------- what is drawn */

static unsigned whole(chance *c, unsigned low, unsigned high) {
    return low + (unsigned)chance_uniform(c, 0, high - low + 1);
}

/* Each power of ten is as likely as any other. */
static double scaled(chance *c, double low, double high) {
    return exp(chance_uniform(c, log(low), log(high)));
}

swarm_drive swarm_drawn(uint64_t seed) {
    chance c = chance_seeded(seed, 1);
    swarm_drive d = {.blow = (swarm_blow)(seed % SWARM_BLOWS)};
    d.points = whole(&c, 5, MOST_POINTS);
    d.slots = whole(&c, 20, 100);
    d.frame_hz = whole(&c, 20, 60);
    d.readings_per_frame = whole(&c, 5, 10);
    d.far_m = scaled(&c, 3, 60);
    d.scatter_mps2 = scaled(&c, 0.1, 5);
    d.hardest_mps2 = chance_uniform(&c, 5, 40);
    d.hardest_radps = chance_uniform(&c, 0, 2);
    d.longest_s = 0.3;
    if (d.blow == BLOW_UNSEEN) {
        d.points = 8;
        d.hardest_mps2 = 5;
        d.hardest_radps = 2;
        d.longest_s = 0.4;
    }
    return d;
}

static void draw_direction(chance *c, double length, double x[3]) {
    double sum = 0;
    for (int i = 0; i < 3; i++) {
        x[i] = chance_normal(c);
        sum += x[i] * x[i];
    }
    for (int i = 0; i < 3; i++)
        x[i] *= length / sqrt(sum);
}

static void draw_blows(body *b) {
    double t_s = 0;
    for (unsigned k = 0; k < BLOWS; k++) {
        blow *x = &b->blows[k];
        const double share = b->is.blow == BLOW_UNSEEN ? 1 : chance_uniform(&b->motion, 0.3, 1);
        x->from_s = t_s + REST_S + chance_uniform(&b->motion, 0, 0.1);
        x->lasts_s = b->is.longest_s * (b->is.blow == BLOW_UNSEEN ? 1 : share);
        draw_direction(&b->motion, share * b->is.hardest_mps2, x->a_mps2);
        draw_direction(&b->motion, share * b->is.hardest_radps, x->w_radps);
        t_s = x->from_s + x->lasts_s;
    }
}

/* ---------------------------------------------------------------- the body and its sensors */

/* The body is thrown to and fro, a whole wave of acceleration, and stands again; its rate rises and falls.
 * The path of each blow is known in closed form. */
static plr_pose pose_at(const body *b, double t_s) {
    plr_pose T = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0}};
    for (unsigned k = 0; b->is.blow == BLOW_BODY && k < BLOWS && b->blows[k].from_s < t_s; k++) {
        const blow *x = &b->blows[k];
        const double T_s = x->lasts_s, tau = fmin(t_s - x->from_s, T_s), wave = 2 * PI / T_s;
        const double way = (tau - sin(wave * tau) / wave) / wave;
        const double turn = (tau - sin(wave * tau) / wave) / 2;
        const double xi[6] = {
            0, 0, 0, turn * x->w_radps[0], turn * x->w_radps[1], turn * x->w_radps[2]};
        T = pose_moved(&T, xi);
        for (int i = 0; i < 3; i++)
            T.p[i] += way * x->a_mps2[i];
    }
    return T;
}

static const blow *blow_at(const body *b, double t_s) {
    for (unsigned k = 0; k < BLOWS; k++)
        if (t_s > b->blows[k].from_s && t_s < b->blows[k].from_s + b->blows[k].lasts_s)
            return &b->blows[k];
    return NULL;
}

static plr_imu read(body *b, double t_s) {
    const plr_pose T = pose_at(b, t_s);
    const blow *x = blow_at(b, t_s);
    double f_W[3] = {0, 0, GRAVITY}, wrong[2] = {0, 0};
    plr_imu imu = {{0}, {0}};
    if (x && b->is.blow == BLOW_BODY) {
        const double phase = 2 * PI * (t_s - x->from_s) / x->lasts_s;
        for (int i = 0; i < 3; i++) {
            f_W[i] += sin(phase) * x->a_mps2[i];
            imu.w_B_radps[i] = (1 - cos(phase)) / 2 * x->w_radps[i];
        }
    } else if (x) {
        wrong[0] = wrong[1] = 1;
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            imu.a_B_mps2[i] += T.R[3 * j + i] * f_W[j];
        imu.a_B_mps2[i] += b->bias[i] + b->is.scatter_mps2 * chance_normal(&b->noise);
        imu.w_B_radps[i] += b->bias[3 + i] + 0.01 * b->is.scatter_mps2 * chance_normal(&b->noise);
        if (x) {
            imu.a_B_mps2[i] += wrong[0] * x->a_mps2[i];
            imu.w_B_radps[i] += wrong[1] * x->w_radps[i];
        }
    }
    return imu;
}

/* (uL, vL, uR, vR) without noise; false if the point is not in sight of both cameras. */
static bool project(const body *b, const plr_pose *T, const double m[3], double z[4]) {
    const plr_calibration *c = &b->calibration;
    double x_B[3], q[3];
    pose_inwards(T, m, x_B);
    pose_outwards(&c->T_CB, x_B, q);
    if (!(q[2] > 0.5))
        return false;
    z[0] = c->fx_px * q[0] / q[2] + c->cx_px;
    z[1] = z[3] = c->fy_px * q[1] / q[2] + c->cy_px;
    z[2] = c->fx_px * (q[0] - c->baseline_m) / q[2] + c->cx_px;
    return z[2] >= 0 && z[0] < WIDTH_PX && z[1] >= 0 && z[1] < HEIGHT_PX;
}

/* A new point in the picture, under a new id. */
static void place(body *b, const plr_pose *T, unsigned k, double z[4]) {
    const plr_calibration *c = &b->calibration;
    do {
        const double depth = scaled(&b->scene, NEAR_M, b->is.far_m);
        const double u = chance_uniform(&b->scene, 0, WIDTH_PX);
        const double v = chance_uniform(&b->scene, 0, HEIGHT_PX);
        const double q[3] = {depth * (u - c->cx_px) / c->fx_px, depth * (v - c->cy_px) / c->fy_px,
                             depth};
        double x_B[3];
        pose_inwards(&c->T_CB, q, x_B);
        pose_outwards(T, x_B, b->point_m[k]);
    } while (!project(b, T, b->point_m[k], z));
    b->id[k] = b->next_id++;
}

static void look(body *b, const plr_pose *T, plr_observation *seen) {
    for (unsigned k = 0; k < b->is.points; k++) {
        double z[4];
        if (b->id[k] == 0 || !project(b, T, b->point_m[k], z))
            place(b, T, k, z);
        for (int i = 0; i < 4; i++)
            z[i] += chance_normal(&b->noise);
        seen[k] =
            (plr_observation){b->id[k], (float)z[0], (float)z[1], (float)z[2], (float)z[3], 0};
    }
}

/* ---------------------------------------------------------------- what it comes to */

static double length(const double x[3]) {
    return sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
}

/* Returns the largest component of the error in sigmas; HUGE_VAL if the answer is none. */
static double compare(const plr_pose *truth, judge *j, swarm_outcome *o) {
    plr_pose pose;
    plr_twist v;
    double P[36], P_u[36], xi[6], worst = 0;
    const bool answers = plr_filter_pose(&filter, &pose) == PLR_OK &&
                         plr_filter_pose_covariance(&filter, P) == PLR_OK &&
                         plr_filter_velocity(&filter, &v) == PLR_OK &&
                         plr_filter_velocity_covariance(&filter, P_u) == PLR_OK;
    if (!answers)
        return HUGE_VAL; /* a divergence, which the totals count */
    pose_error(&pose, truth, xi);
    bool finite = isfinite(v.v_B_mps[0] + v.v_B_mps[1] + v.v_B_mps[2]);
    for (int i = 0; i < 6; i++) {
        finite = finite && isfinite(xi[i]) && P[7 * i] > 0 && isfinite(P[7 * i]) &&
                 P_u[7 * i] > 0 && isfinite(P_u[7 * i]);
        worst = fmax(worst, fabs(xi[i]) / sqrt(P[7 * i]));
    }
    o->not_finite += !finite;
    o->worst_v_sigma_mps = fmax(o->worst_v_sigma_mps, sqrt(P_u[0] + P_u[7] + P_u[14]));
    for (int i = 0; i < 3; i++)
        j->error_m[i] = pose.p[i] - truth->p[i];
    o->worst_m = fmax(o->worst_m, length(j->error_m));
    return worst;
}

/* A blow that begins keeps the error before it. */
static void begin_blow(const body *b, double t_s, judge *j, swarm_outcome *o) {
    if (j->blow == BLOWS || t_s < b->blows[j->blow].from_s)
        return;
    if (j->blow > 0 && !j->good_again)
        o->again_s = HUGE_VAL;
    j->blow++;
    j->good_again = j->left = false;
    memcpy(j->before_m, j->error_m, sizeof j->before_m);
}

/* What a blow has left two seconds after its end, and when health was good again. */
static void follow(const body *b, double t_s, bool good, double sigmas, judge *j,
                   swarm_outcome *o) {
    if (j->blow == 0)
        return;
    const blow *x = &b->blows[j->blow - 1];
    const double since_s = t_s - x->from_s - x->lasts_s;
    if (since_s >= 0 && good && !j->good_again) {
        j->good_again = true;
        o->again_s = fmax(o->again_s, since_s);
    }
    if (since_s >= 2 && !j->left) {
        double moved[3];
        for (int i = 0; i < 3; i++)
            moved[i] = j->error_m[i] - j->before_m[i];
        j->left = true;
        o->left_m = fmax(o->left_m, length(moved));
        o->left_sigmas = fmax(o->left_sigmas, sigmas);
    }
}

static void take_frame(body *b, plr_time_ns t_ns, judge *j, swarm_outcome *o) {
    const double t_s = (double)(t_ns - START_NS) * 1e-9;
    const plr_pose truth = pose_at(b, t_s);
    plr_observation seen[MOST_POINTS];
    plr_report report;
    plr_totals totals;
    look(b, &truth, seen);
    const plr_frame frame = {t_ns, PLR_NO_BUDGET, (uint16_t)b->is.points, seen};
    o->refused += plr_filter_update(&filter, &frame, &report) != PLR_OK;
    begin_blow(b, t_s, j, o);
    const double sigmas = compare(&truth, j, o);
    const bool good = report.health == PLR_HEALTH_GOOD;
    o->frames++;
    o->good += good;
    o->silent += good && !(sigmas <= BEYOND);
    if (plr_filter_totals(&filter, &totals) == PLR_OK && totals.recoveries > o->diverged) {
        if (o->diverged == 0)
            o->first_diverged_s = t_s;
        o->diverged = totals.recoveries;
    }
    follow(b, t_s, good, sigmas, j, o);
}

/* ---------------------------------------------------------------- the drive */

/* Body forward, left, up; the camera looks ahead. */
static void set_calibration(plr_calibration *c) {
    static const double R_CB[9] = {0, -1, 0, 0, 0, -1, 1, 0, 0}, p_CB[3] = {0.05, 0.02, -0.05};
    memset(c, 0, sizeof *c);
    c->fx_px = c->fy_px = 450;
    c->cx_px = WIDTH_PX / 2.0;
    c->cy_px = HEIGHT_PX / 2.0;
    c->baseline_m = 0.12;
    memcpy(c->T_CB.R, R_CB, sizeof R_CB);
    memcpy(c->T_CB.p, p_CB, sizeof p_CB);
}

static void begin(body *b, uint64_t seed) {
    static const double still[3] = {0}, known[3] = {1e-4, 1e-4, 1e-4};
    plr_config config;
    memset(b, 0, sizeof *b);
    b->is = swarm_drawn(seed);
    b->motion = chance_seeded(seed, 2);
    b->noise = chance_seeded(seed, 3);
    b->scene = chance_seeded(seed, 4);
    b->next_id = 1;
    set_calibration(&b->calibration);
    draw_blows(b);
    for (int i = 0; i < 6; i++)
        b->bias[i] = (i < 3 ? 0.05 : 0.005) * chance_normal(&b->noise);
    plr_config_default(&config);
    exact_camera(&config);
    config.process = PLR_PROCESS_IMU;
    config.pixel_sigma_px = 1;
    config.slots = (uint16_t)b->is.slots;
    const plr_pose start = pose_at(b, 0);
    (void)plr_filter_init(&filter, &b->calibration, &config, NULL);
    (void)plr_filter_set_pose(&filter, START_NS, &start, NULL);
    (void)plr_filter_set_velocity(&filter, still, known);
}

void swarm_run(uint64_t seed, swarm_outcome *result) {
    static body b;
    judge j = {0};
    memset(result, 0, sizeof *result);
    begin(&b, seed);
    const double hz = b.is.frame_hz * b.is.readings_per_frame;
    const blow *last = &b.blows[BLOWS - 1];
    const unsigned readings = (unsigned)((last->from_s + last->lasts_s + REST_S) * hz);
    for (unsigned k = 1; k <= readings; k++) {
        const plr_time_ns t_ns = START_NS + (plr_time_ns)(k * 1e9 / hz);
        if (k % b.is.readings_per_frame == 0)
            take_frame(&b, t_ns - (plr_time_ns)whole(&b.motion, 0, MOST_LEAD_NS - 1), &j, result);
        const plr_imu imu = read(&b, (double)(t_ns - START_NS) * 1e-9);
        result->refused += plr_filter_inertial(&filter, t_ns, &imu) != PLR_OK;
    }
    if (!j.good_again)
        result->again_s = HUGE_VAL;
    result->done = true;
}
