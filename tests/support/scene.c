// SPDX-License-Identifier: MIT
#include "support/scene.h"

#include <math.h>
#include <string.h>

#include "support/rigid.h"

enum { FIRST_ID = 100, WIDTH_PX = 960, HEIGHT_PX = 600 };

void scene_calibration(plr_calibration *calibration) {
    /* forward-left-up to right-down-forward, then a small turn */
    static const double axes[16] = {0, -1, 0, 0, 0, 0, -1, 0, 1, 0, 0, 0, 0, 0, 0, 1};
    static const double askew[6] = {0, 0, 0, 0.03, -0.05, 0.02};
    static const double lever_m[3] = {0.5, 0.06, 0.1}; /* the camera, in the body */
    double turn[16], T_CB[16];
    rigid_exp(turn, askew);
    square_multiply(4, turn, axes, T_CB);
    memset(calibration, 0, sizeof *calibration);
    calibration->fx_px = 480;
    calibration->fy_px = 470;
    calibration->cx_px = 476;
    calibration->cy_px = 304;
    calibration->baseline_m = 0.25;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            calibration->T_CB.R[3 * i + j] = T_CB[4 * i + j];
            calibration->T_CB.p[i] -= T_CB[4 * i + j] * lever_m[j];
        }
}

void scene_options_default(scene_options *options) {
    *options = (scene_options){.seed = 1,
                               .landmarks = 150,
                               .most_seen = 40,
                               .near_m = 1,
                               .range_m = 25,
                               .speed_mps = 2,
                               .turn_radps = 0.2,
                               .sway = 1,
                               .pixel_sigma_px = 1,
                               .velocity_sigma_mps = 0.05,
                               .gyro_sigma_radps = 0.01};
}

/* Landmarks in a disc around the circle that the body drives, up to the camera's range beyond it. */
static void place_landmarks(scene *s) {
    const scene_options *o = &s->is;
    const double turn = o->turn_radps > 1e-6 ? o->turn_radps : 1;
    const double radius = o->speed_mps / turn, reach = radius + o->range_m;
    for (unsigned i = 0; i < o->landmarks; i++) {
        double x, y;
        do {
            x = rng_uniform(&s->chance, -reach, reach);
            y = rng_uniform(&s->chance, -reach, reach);
        } while (x * x + y * y > reach * reach);
        s->p_W[i][0] = x;
        s->p_W[i][1] = radius + y;
        s->p_W[i][2] = rng_uniform(&s->chance, -3, 5);
    }
}

void scene_start(scene *s, const scene_options *options) {
    memset(s, 0, sizeof *s);
    s->is = *options;
    s->chance = rng_seeded(options->seed);
    scene_calibration(&s->calibration);
    s->t_ns = UINT64_C(1000000000);
    for (int i = 0; i < 4; i++)
        s->T_WB[5 * i] = 1;
    place_landmarks(s);
}

void scene_true_twist(const scene *s, plr_twist *twist) {
    const scene_options *o = &s->is;
    const double t = (double)s->t_ns * 1e-9, a = o->sway;
    const plr_twist u = {.v_B_mps = {o->speed_mps + a * 0.4 * sin(0.5 * t), a * 0.1 * sin(0.9 * t),
                                     a * 0.05 * cos(0.7 * t)},
                         .w_B_radps = {a * 0.05 * sin(1.1 * t), a * 0.05 * cos(0.8 * t),
                                       o->turn_radps + a * 0.06 * sin(0.3 * t)}};
    *twist = u;
}

plr_twist scene_read(scene *s) {
    plr_twist reading;
    scene_true_twist(s, &reading);
    for (int i = 0; i < 3; i++) {
        reading.v_B_mps[i] += s->is.bias[i] + s->is.velocity_sigma_mps * rng_normal(&s->chance);
        reading.w_B_radps[i] += s->is.bias[3 + i] + s->is.gyro_sigma_radps * rng_normal(&s->chance);
    }
    return reading;
}

void scene_move(scene *s, plr_time_ns step_ns) {
    const double seconds = (double)step_ns * 1e-9;
    plr_twist u;
    double xi[6], D[16], T[16];
    scene_true_twist(s, &u);
    for (int i = 0; i < 3; i++) {
        xi[i] = seconds * u.v_B_mps[i];
        xi[3 + i] = seconds * u.w_B_radps[i];
    }
    rigid_exp(D, xi);
    square_multiply(4, s->T_WB, D, T);
    memcpy(s->T_WB, T, sizeof T);
    s->t_ns += step_ns;
}

/* q = T_CB T_WB^-1 m */
static void in_camera(const scene *s, const double m[3], double q[3]) {
    const plr_pose *T_CB = &s->calibration.T_CB;
    double T_BW[16], x_B[3];
    rigid_inverse(T_BW, s->T_WB);
    for (int i = 0; i < 3; i++)
        x_B[i] =
            T_BW[4 * i] * m[0] + T_BW[4 * i + 1] * m[1] + T_BW[4 * i + 2] * m[2] + T_BW[4 * i + 3];
    for (int i = 0; i < 3; i++)
        q[i] = T_CB->R[3 * i] * x_B[0] + T_CB->R[3 * i + 1] * x_B[1] + T_CB->R[3 * i + 2] * x_B[2] +
               T_CB->p[i];
}

/* (uL, vL, uR, vR) without noise; false if it lies outside of an image or of the camera's range. */
static bool project(const scene *s, const double q[3], double z[4]) {
    const plr_calibration *c = &s->calibration;
    if (!(q[2] >= s->is.near_m && q[2] <= s->is.range_m))
        return false;
    z[0] = c->fx_px * q[0] / q[2] + c->cx_px;
    z[2] = c->fx_px * (q[0] - c->baseline_m) / q[2] + c->cx_px;
    z[1] = z[3] = c->fy_px * q[1] / q[2] + c->cy_px;
    return z[0] >= 0 && z[0] < WIDTH_PX && z[2] >= 0 && z[2] < WIDTH_PX && z[1] >= 0 &&
           z[1] < HEIGHT_PX;
}

static plr_observation measure(scene *s, uint32_t id, const double z[4]) {
    const bool blurred = s->is.blur > 0 && id % 2 == 1;
    const double sigma = s->is.pixel_sigma_px * (blurred ? s->is.blur : 1);
    double seen[4];
    for (int i = 0; i < 4; i++)
        seen[i] = z[i] + sigma * rng_normal(&s->chance);
    if (s->is.outliers > 0 && rng_uniform(&s->chance, 0, 1) < s->is.outliers) {
        seen[0] = rng_uniform(&s->chance, 60, WIDTH_PX);
        seen[2] = seen[0] - rng_uniform(&s->chance, 5, 60);
        seen[1] = seen[3] = rng_uniform(&s->chance, 0, HEIGHT_PX);
    }
    if (s->is.left_alone > 0 && rng_uniform(&s->chance, 0, 1) < s->is.left_alone)
        seen[2] = seen[3] = (double)PLR_NOT_SEEN_PX;
    return (plr_observation){id,
                             (float)seen[0],
                             (float)seen[1],
                             (float)seen[2],
                             (float)seen[3],
                             s->is.tells_sigma ? (float)sigma : 0};
}

plr_frame scene_look(scene *s) {
    uint16_t count = 0;
    for (unsigned i = 0; i < s->is.landmarks && count < s->is.most_seen; i++) {
        double q[3], z[4];
        in_camera(s, s->p_W[i], q);
        if (project(s, q, z))
            s->seen[count++] = measure(s, FIRST_ID + i, z);
    }
    return (plr_frame){s->t_ns, PLR_NO_BUDGET, count, s->seen};
}

void scene_pose(const scene *s, plr_pose *T_WB) {
    for (int i = 0; i < 3; i++) {
        memcpy(T_WB->R + 3 * i, s->T_WB + 4 * i, 3 * sizeof(double));
        T_WB->p[i] = s->T_WB[4 * i + 3];
    }
}

const double *scene_landmark(const scene *s, uint32_t id) {
    return s->p_W[id - FIRST_ID];
}

plr_landmark scene_known(const scene *s, uint32_t id, double sigma_m) {
    const double *p = scene_landmark(s, id), P = sigma_m * sigma_m;
    return (plr_landmark){
        .id = id, .p_W_m = {p[0], p[1], p[2]}, .P_W_m2 = {P, 0, 0, 0, P, 0, 0, 0, P}};
}

plr_calibration scene_bare_camera(double f_px, double cx_px, double cy_px, double baseline_m) {
    return (plr_calibration){.fx_px = f_px,
                             .fy_px = f_px,
                             .cx_px = cx_px,
                             .cy_px = cy_px,
                             .baseline_m = baseline_m,
                             .T_CB.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
}
