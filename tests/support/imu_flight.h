// SPDX-License-Identifier: MIT
/*
 * A body with an IMU and a stereo camera that flies a smooth path among points, in double, by
 * support/rigid.h: it shares no code with the filter. Velocity and acceleration are differences of
 * the path, so the readings fit it to 1e-7.
 */
#ifndef PELORUS_TEST_IMU_FLIGHT_H
#define PELORUS_TEST_IMU_FLIGHT_H

#include "pelorus/types.h"
#include "support/random.h"

enum { IMU_FLIGHT_POINTS = 400, IMU_FLIGHT_MOST_SEEN = 120 };

typedef struct imu_flight_options {
    uint64_t seed;
    double rate_hz; /* of the IMU */
    double rest_s;  /* the body stands before it moves */
    double ahead_s; /* or it moves already: the path begins there */
    double swing;   /* it turns to and fro so many times as fast */
    double gyro_noise, accel_noise, gyro_walk, accel_walk; /* densities, as in the settings */
    double bias_accel_sigma, bias_gyro_sigma;              /* of what is drawn at the start */
    double pixel_sigma_px;
    unsigned most_seen; /* points in a frame */
    double gravity_mps2;
} imu_flight_options;

typedef struct imu_flight {
    imu_flight_options is;
    rng chance;
    plr_calibration calibration;
    plr_time_ns t_ns;
    double bias[6]; /* (b_a, b_g) now */
    double p_W[IMU_FLIGHT_POINTS][3];
    uint32_t id[IMU_FLIGHT_POINTS]; /* another one each time that a point comes into sight */
    bool in_sight[IMU_FLIGHT_POINTS];
    uint32_t next_id;
    plr_observation seen[IMU_FLIGHT_MOST_SEEN];
} imu_flight;

/* 400 Hz, a consumer IMU, 1 px, 40 points in a frame. */
void imu_flight_options_default(imu_flight_options *options);

/* At 1 s. */
void imu_flight_start(imu_flight *s, const imu_flight_options *options);

/* Truth now: the pose, 4x4, and the velocity in body axes. */
void imu_flight_truth(const imu_flight *s, double T_WB[16], double v_B[3]);

/* A sample of the IMU, with bias and noise. */
plr_imu imu_flight_read(imu_flight *s);

/* On to the next sample; the biases walk. */
void imu_flight_move(imu_flight *s);

/* What the camera sees now. The observations hold until the next look. */
plr_frame imu_flight_look(imu_flight *s);

#endif
