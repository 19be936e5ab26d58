// SPDX-License-Identifier: MIT
#include "campaign/world.h"

#include <math.h>
#include <string.h>

static const double PI = 3.14159265358979323846, FOCAL_PX = 500, CONVOY_SPEED = 0.8;
static const double CIRCLE_RADPS = 0.31415926535897931; /* of a room: once around in 20 s */

/* Body forward, left, up; camera right, down, forward, 0.2 m ahead of the body and 0.1 m above. */
void world_calibration(const scenario *s, plr_calibration *calibration) {
    static const double R_CB[9] = {0, -1, 0, 0, 0, -1, 1, 0, 0};
    static const double p_CB[3] = {0, 0.1, -0.2};
    memset(calibration, 0, sizeof *calibration);
    calibration->fx_px = calibration->fy_px = FOCAL_PX;
    calibration->cx_px = WIDTH_PX / 2.0;
    calibration->cy_px = HEIGHT_PX / 2.0;
    calibration->baseline_m = s->baseline_m;
    memcpy(calibration->T_CB.R, R_CB, sizeof R_CB);
    memcpy(calibration->T_CB.p, p_CB, sizeof p_CB);
}

/* A new point anywhere in the picture, anywhere in depth. The true position decides, no noise. */
static void place(world *w, point *p) {
    const plr_calibration *c = &w->calibration;
    double z[4];
    do {
        const double depth = chance_uniform(&w->chance, w->s->near_m, w->s->far_m);
        const double u = chance_uniform(&w->chance, 0, WIDTH_PX);
        const double v = chance_uniform(&w->chance, 0, HEIGHT_PX);
        const double q[3] = {depth * (u - c->cx_px) / c->fx_px - w->camera_shift_m,
                             depth * (v - c->cy_px) / c->fy_px, depth};
        double x_B[3];
        pose_inwards(&c->T_CB, q, x_B);
        pose_outwards(&w->T_WB, x_B, p->m);
    } while (!world_project(w, p, z));
    p->lot = chance_uniform(&w->chance, 0, 1);
    p->drift_px[0] = p->drift_px[1] = 0;
    p->id = w->next_id++;
}

/* The same for a point that keeps its id. */
static void swap(world *w, point *p) {
    const uint32_t id = p->id;
    place(w, p);
    p->id = id;
}

/* A point of a room: anywhere around, at the height of the camera more or less. */
static void place_around(world *w, point *p) {
    const double distance = chance_uniform(&w->chance, w->s->near_m, w->s->far_m);
    const double bearing = chance_uniform(&w->chance, -PI, PI);
    p->m[0] = distance * cos(bearing);
    p->m[1] = distance * sin(bearing);
    p->m[2] = 0.1 + distance * chance_uniform(&w->chance, -0.4, 0.4);
    p->drift_px[0] = p->drift_px[1] = 0;
    p->id = w->next_id++;
}

/* Turns the camera about its own middle by `degrees`, about any axis. */
static void turn_askew(plr_pose *T_CB, double degrees, chance *c) {
    static const plr_pose level = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0}};
    double turn[6] = {0, 0, 0, chance_normal(c), chance_normal(c), chance_normal(c)}, length = 0;
    for (int i = 3; i < 6; i++)
        length += turn[i] * turn[i];
    for (int i = 3; i < 6; i++)
        turn[i] *= degrees * PI / 180 / sqrt(length);
    const plr_pose turned = pose_moved(&level, turn);
    for (int column = 0; column < 4; column++) {
        double x[3], y[3];
        for (int i = 0; i < 3; i++)
            x[i] = column < 3 ? T_CB->R[3 * i + column] : T_CB->p[i];
        pose_outwards(&turned, x, y);
        for (int i = 0; i < 3; i++)
            *(column < 3 ? &T_CB->R[3 * i + column] : &T_CB->p[i]) = y[i];
    }
}

void world_begin(world *w, const scenario *s, uint64_t seed) {
    memset(w, 0, sizeof *w);
    w->s = s;
    w->chance = chance_seeded(seed, 1);
    world_calibration(s, &w->calibration);
    if (s->mishap == BASELINE)
        w->calibration.baseline_m *= 1 + s->strength;
    if (s->mishap == FOCAL)
        w->calibration.fx_px = w->calibration.fy_px *= 1 + s->strength;
    if (s->mishap == ASKEW)
        turn_askew(&w->calibration.T_CB, s->strength, &w->chance);
    for (int i = 0; i < 6; i++)
        w->phase[i] = chance_uniform(&w->chance, 0, 2 * PI);
    for (int i = 0; i < 3; i++)
        w->T_WB.R[4 * i] = 1;
    w->step_s = 1.0 / (FRAME_HZ * s->twists_per_frame);
    w->next_id = 1;
    for (unsigned i = 0; i < s->landmarks; i++)
        (s->room ? place_around : place)(w, &w->points[i]);
}

void world_choose_twist(world *w) {
    const double v = w->s->speed_mps, a = w->s->turn, t = w->t_s, *ph = w->phase;
    const plr_twist u = {
        .v_B_mps = {v * (1 + 0.3 * sin(0.5 * t + ph[0])), 0.1 * v * sin(0.9 * t + ph[1]),
                    0.05 * v * sin(0.7 * t + ph[2])},
        .w_B_radps = {a * 0.05 * sin(1.1 * t + ph[3]), a * 0.05 * sin(0.8 * t + ph[4]),
                      a * (0.1 + 0.15 * sin(0.3 * t + ph[5]))}};
    w->twist = u;
    if (w->s->room)
        w->twist.w_B_radps[2] = a * CIRCLE_RADPS;
}

static void move_points(world *w) {
    const mishap what = w->s->mishap;
    double v_B[3] = {0};
    if (what == SCENE_MOVES)
        v_B[1] = w->s->strength;
    else
        for (int i = 0; i < 3; i++)
            v_B[i] = CONVOY_SPEED * w->twist.v_B_mps[i];
    for (unsigned k = 0; k < w->s->landmarks; k++) {
        point *p = &w->points[k];
        if (what == CONVOY && p->lot >= w->s->strength)
            continue;
        for (int i = 0; i < 3; i++) {
            const double *R = w->T_WB.R + 3 * i;
            const double v_W =
                what == SCENE_MOVES ? v_B[i] : R[0] * v_B[0] + R[1] * v_B[1] + R[2] * v_B[2];
            p->m[i] += w->step_s * v_W;
        }
    }
}

void world_step(world *w, bool event) {
    double xi[6];
    if (event && (w->s->mishap == SCENE_MOVES || w->s->mishap == CONVOY))
        move_points(w);
    for (int i = 0; i < 3; i++) {
        xi[i] = w->step_s * w->twist.v_B_mps[i];
        xi[3 + i] = w->step_s * w->twist.w_B_radps[i];
    }
    w->T_WB = pose_moved(&w->T_WB, xi);
    w->t_s += w->step_s;
}

void world_strike(world *w) {
    const double a = w->s->strength;
    if (w->s->mishap == JUMP_BODY) {
        const double aside[6] = {0, a, 0, 0, 0, 0};
        w->T_WB = pose_moved(&w->T_WB, aside);
    } else if (w->s->mishap == THROWN) {
        const double thrown[6] = {3 * a, 4 * a, 0, 0, 0, a};
        w->T_WB = pose_moved(&w->T_WB, thrown);
    } else if (w->s->mishap == JUMP_CAMERA || w->s->mishap == CAMERA_BACK) {
        w->camera_shift_m = a;
    } else if (w->s->mishap == TURN_CAMERA) {
        w->camera_turn_rad = a;
    } else if (w->s->mishap == SWAPPED) {
        for (unsigned k = 0; k < w->s->landmarks; k++)
            swap(w, &w->points[k]);
    }
}

void world_mend(world *w) {
    if (w->s->mishap == CAMERA_BACK || w->s->mishap == TURN_CAMERA)
        w->camera_shift_m = w->camera_turn_rad = 0;
}

bool world_project(const world *w, const point *p, double z[4]) {
    const plr_calibration *c = &w->calibration;
    const double cosine = cos(w->camera_turn_rad), sine = sin(w->camera_turn_rad);
    double x_B[3], ahead[3], q[3];
    pose_inwards(&w->T_WB, p->m, x_B);
    pose_outwards(&c->T_CB, x_B, ahead);
    q[0] = cosine * ahead[0] - sine * ahead[2] + w->camera_shift_m;
    q[1] = ahead[1];
    q[2] = sine * ahead[0] + cosine * ahead[2];
    if (!(q[2] >= 0.3 * w->s->near_m && q[2] <= 3 * w->s->far_m))
        return false;
    z[0] = c->fx_px * q[0] / q[2] + c->cx_px;
    z[1] = z[3] = c->fy_px * q[1] / q[2] + c->cy_px;
    z[2] = c->fx_px * (q[0] - c->baseline_m) / q[2] + c->cx_px;
    return z[0] >= 0 && z[0] < WIDTH_PX && z[2] >= 0 && z[2] < WIDTH_PX && z[1] >= 0 &&
           z[1] < HEIGHT_PX;
}

static void wander(world *w, point *p) {
    for (int i = 0; i < 2; i++)
        p->drift_px[i] += w->s->track_drift / sqrt(FRAME_HZ) * chance_normal(&w->chance);
}

void world_renew(world *w) {
    double z[4];
    for (unsigned k = 0; k < w->s->landmarks && !w->s->room; k++)
        if (!world_project(w, &w->points[k], z))
            place(w, &w->points[k]);
        else if (w->s->lost_tracks > 0 && chance_uniform(&w->chance, 0, 1) < w->s->lost_tracks)
            swap(w, &w->points[k]);
        else if (w->s->track_drift > 0)
            wander(w, &w->points[k]);
}
