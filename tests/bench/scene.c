// SPDX-License-Identifier: MIT
#include "scene.h"

#include <math.h>
#include <string.h>

static const double sway_m = 0.2, sway_radps = 1.0, pixel_sigma = 1.0;

void scene_init(scene *s, unsigned count) {
    memset(s, 0, sizeof *s);
    s->count = count;
    s->frames_per_second = 20;
    s->noise = rng_seeded(1);
    s->calibration = (plr_calibration){.fx_px = 500,
                                       .fy_px = 500,
                                       .cx_px = 320,
                                       .cy_px = 240,
                                       .baseline_m = 0.3,
                                       .T_CB.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    for (unsigned i = 0; i < count; i++) {
        const double depth = rng_uniform(&s->noise, 4, 40);
        s->points_W[i][0] = rng_uniform(&s->noise, -0.6, 0.6) * depth;
        s->points_W[i][1] = rng_uniform(&s->noise, -0.4, 0.4) * depth;
        s->points_W[i][2] = depth;
    }
}

plr_time_ns scene_time(const scene *s, unsigned k) {
    return (plr_time_ns)(1000000000.0 * (1 + k / s->frames_per_second));
}

/* The camera sways along its x axis: x = sway sin(w t). */
static double place(const scene *s, unsigned k) {
    return sway_m * sin(sway_radps * k / s->frames_per_second);
}

void scene_twist(const scene *s, unsigned k, plr_twist *twist) {
    memset(twist, 0, sizeof *twist);
    twist->v_B_mps[0] = (place(s, k + 1) - place(s, k)) * s->frames_per_second;
}

/* Since frame 0. */
static double phase(plr_time_ns t_ns) {
    return sway_radps * ((double)t_ns * 1e-9 - 1);
}

void scene_imu(scene *s, plr_time_ns t_ns, plr_imu *imu) {
    double noise[6];
    rng_normals(&s->noise, 1e-3, noise, 6);
    *imu = (plr_imu){.a_B_mps2 = {noise[0] - sway_m * sway_radps * sway_radps * sin(phase(t_ns)),
                                  noise[1], noise[2] + 9.81},
                     .w_B_radps = {noise[3], noise[4], noise[5]}};
}

void scene_velocity(const scene *s, plr_time_ns t_ns, double v_B_mps[3]) {
    (void)s;
    v_B_mps[0] = sway_m * sway_radps * cos(phase(t_ns));
    v_B_mps[1] = v_B_mps[2] = 0;
}

void scene_frame(scene *s, unsigned k, plr_frame *frame) {
    const plr_calibration *c = &s->calibration;
    for (unsigned i = 0; i < s->count; i++) {
        const double x = s->points_W[i][0] - place(s, k);
        const double y = s->points_W[i][1], z = s->points_W[i][2];
        double e[4];
        rng_normals(&s->noise, pixel_sigma, e, 4);
        s->observations[i] = (plr_observation){
            .id = i + 1,
            .uL_px = (float)(c->fx_px * x / z + c->cx_px + e[0]),
            .vL_px = (float)(c->fy_px * y / z + c->cy_px + e[1]),
            .uR_px = (float)(c->fx_px * (x - c->baseline_m) / z + c->cx_px + e[2]),
            .vR_px = (float)(c->fy_px * y / z + c->cy_px + e[3])};
    }
    *frame = (plr_frame){.t_ns = scene_time(s, k),
                         .budget = PLR_NO_BUDGET,
                         .count = (uint16_t)s->count,
                         .observations = s->observations};
}
