// SPDX-License-Identifier: MIT
/*
 * A small simulated world for tests of the filter: landmarks, a body that drives a circle through
 * them, a noisy twist sensor and a noisy stereo camera. Seeded, in double, by support/rigid.h: it
 * shares no code with the filter.
 *
 * The true twist is constant from one scene_move to the next, and scene_read gives it at the start
 * of that step: twist timing `start` is exact.
 */
#ifndef PELORUS_TEST_SCENE_H
#define PELORUS_TEST_SCENE_H

#include "pelorus/types.h"
#include "support/random.h"

enum { SCENE_MAX_LANDMARKS = 600, SCENE_MAX_SEEN = 256 };

typedef struct scene_options {
    uint64_t seed;
    unsigned landmarks;     /* in the world, at most SCENE_MAX_LANDMARKS */
    unsigned most_seen;     /* in one frame; those of the lowest ids */
    double near_m, range_m; /* depths between which a landmark is seen */
    double speed_mps, turn_radps;
    double sway;           /* 1: a driver's unsteadiness on all six axes; 0: none */
    double pixel_sigma_px; /* true noise, of each coordinate */
    double velocity_sigma_mps, gyro_sigma_radps;
    double bias[6];    /* (b_v, b_w), constant */
    double outliers;   /* fraction of observations that lie anywhere in the image */
    double blur;       /* so much larger is the noise of the points of odd ids; 0: it is not */
    bool tells_sigma;  /* each observation says its own */
    double left_alone; /* fraction of observations of the left picture alone */
} scene_options;

typedef struct scene {
    scene_options is;
    rng chance;
    plr_calibration calibration;
    plr_time_ns t_ns;
    double T_WB[16];
    double p_W[SCENE_MAX_LANDMARKS][3]; /* landmark i has id 100 + i */
    plr_observation seen[SCENE_MAX_SEEN];
} scene;

/* Body axes forward, left, up; the camera looks ahead, half a metre in front of the body's origin,
 * a few degrees askew. */
void scene_calibration(plr_calibration *calibration);

/* 150 landmarks, 2 m/s, noise of 1 px, 0.05 m/s, 0.01 rad/s, no bias, no outliers. */
void scene_options_default(scene_options *options);

/* The body at the world's origin, at 1 s. */
void scene_start(scene *s, const scene_options *options);

/* The true twist from now until the next scene_move. */
void scene_true_twist(const scene *s, plr_twist *twist);

/* A reading of it: with bias and noise. */
plr_twist scene_read(scene *s);

/* Moves on by a step: T_WB <- T_WB Exp(step u). */
void scene_move(scene *s, plr_time_ns step_ns);

/* What the camera sees now. The observations hold until the next look. */
plr_frame scene_look(scene *s);

/* T_WB as the interface writes poses. */
void scene_pose(const scene *s, plr_pose *T_WB);

/* Position of the landmark of that id. */
const double *scene_landmark(const scene *s, uint32_t id);

/* The landmark as a map knows it: where it is, to `sigma_m` along each axis. */
plr_landmark scene_known(const scene *s, uint32_t id, double sigma_m);

/* A camera at the body's origin with its axes: it looks along z. */
plr_calibration scene_bare_camera(double f_px, double cx_px, double cy_px, double baseline_m);

#endif
