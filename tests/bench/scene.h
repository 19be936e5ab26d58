// SPDX-License-Identifier: MIT
/* What the bench feeds the filter: a camera that sways before N points and sees all of them. */
#ifndef PELORUS_BENCH_SCENE_H
#define PELORUS_BENCH_SCENE_H

#include "pelorus/types.h"
#include "support/random.h"

enum { SCENE_MAX_POINTS = 256 };

typedef struct scene {
    unsigned count;
    double points_W[SCENE_MAX_POINTS][3];
    double frames_per_second;
    rng noise;
    plr_calibration calibration; /* body and camera axes are the same */
    plr_observation observations[SCENE_MAX_POINTS];
} scene;

/* `count` points between 4 m and 40 m ahead. */
void scene_init(scene *s, unsigned count);

/* The twist that holds from frame k to k + 1. */
void scene_twist(const scene *s, unsigned k, plr_twist *twist);

/* An IMU's reading at t_ns, and the velocity that it moves with. */
void scene_imu(scene *s, plr_time_ns t_ns, plr_imu *imu);
void scene_velocity(const scene *s, plr_time_ns t_ns, double v_B_mps[3]);

/* Frame k: every point, with a pixel's noise. */
void scene_frame(scene *s, unsigned k, plr_frame *frame);

/* Time of frame k. */
plr_time_ns scene_time(const scene *s, unsigned k);

#endif
