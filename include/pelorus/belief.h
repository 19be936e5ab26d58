// SPDX-License-Identifier: MIT
/* A part of the filter's memory (state.h): what is believed of body and landmarks, and the motion that is in the
 * pose but not yet in the covariance. For the library alone. */
#ifndef PELORUS_BELIEF_H
#define PELORUS_BELIEF_H

#include "pelorus/config.h"
#include "pelorus/types.h"

/* The blocks of the state's error before the landmarks, in their order in P. */
typedef enum plr_block_id {
    PLR_BLOCK_POSE,     /* (rho, theta): T_WB Exp(rho, theta) is the truth; m, rad */
    PLR_BLOCK_VELOCITY, /* of the body in its own axes, with an IMU; m/s */
    PLR_BLOCK_BIAS, /* (b_v, b_w) of twists, m/s and rad/s; (b_a, b_g) of an IMU, m/s^2 and rad/s */
    PLR_BLOCKS
} plr_block_id;

/* Their rows in P, laid out once by the process. */
typedef struct plr_layout {
    struct {
        uint8_t row, size; /* size 0: not estimated */
    } block[PLR_BLOCKS];
    uint8_t core;            /* rows of all blocks: the first landmark's row */
    uint8_t errors;          /* of the calibration: columns of S */
    uint8_t driver, drivers; /* first and number of the rows that a motion depends on: the biases of
                                twists; with an IMU theta, velocity and biases */
} plr_layout;

/* One landmark slot. The times stand where no processor needs padding before them. */
typedef struct plr_slot {
    plr_real x[PLR_LANDMARK_DIM]; /* body: q in the current left camera; world: m; metres */
    plr_real beyond; /* body: added to 1 / |x| it gives the inverse range, 1/m; negative where noise
                        in the disparity makes the inverse range less than any point x can have */
    uint32_t id;
    uint32_t times_seen;
    uint32_t times_gated;
    uint32_t last_frame;          /* number of the frame that saw it last */
    uint32_t pixel_hash;          /* checksum of its pixels when it was last seen */
    plr_real innovation_variance; /* of innovation_sum if the innovations are white noise */
    plr_time_ns last_seen_ns;
    plr_real innovation_sum[3]; /* sum of its whitened innovations, older ones weighted less */
    plr_real anchor[PLR_ROWS];  /* its pixels (uL, uR, v) when the body last began to stand */
    plr_time_ns anchor_ns;      /* when that was */
    uint8_t anchored;           /* 1: anchor is filled */
    uint8_t known;              /* 1: given by a map source or plr_filter_insert_known */
    uint8_t moving;             /* 1: the innovations are not white: the point moves */
    uint8_t restarts;           /* times it was initialised again after repeated rejection */
    uint16_t accepted;          /* frames that used it since it was last initialised or far off */
    uint16_t rejected;          /* successive frames in which the gate rejected it */
} plr_slot;

/* A motion that the pose has made, while landmarks and covariance still stand where they were before it:
 * from the beginning of a correction to its retraction, which moves them once for both (docs/MATH.md 10).
 * Between calls there is none, and all of it is zero. */
typedef struct plr_held_motion {
    plr_real E[9], p[3];     /* of the body: (I + E, p) */
    plr_real E_C[9], p_C[3]; /* the same of the left camera */
    uint8_t any;             /* 1: there is one */
} plr_held_motion;

/* What is believed of body and landmarks: the state with its covariance. */
typedef struct plr_belief {
    plr_layout layout; /* layout, model and capacity never change after init */
    uint8_t model;     /* plr_model_kind: of the table of models */
    uint16_t capacity; /* slots, by the setting of that name */

    unsigned count;   /* active slots, dense from 0 */
    plr_time_ns t_ns; /* of the estimate */
    plr_real R_WB[9];
    uint32_t frame_number; /* here no processor needs padding before p_WB */
    double p_WB[3]; /* double in both builds: adding a small step to a float32 would lose it */
    plr_real velocity[PLR_VELOCITY_DIM]; /* with an IMU: of the body in its own axes, m/s */
    plr_real bias[PLR_BIAS_DIM];

    plr_slot slots[PLR_MAX_LANDMARKS];
    plr_real P[PLR_PACKED_SIZE + PLR_KERNEL_MARGIN]; /* packed lower triangle: the blocks of
                                                        plr_layout, landmarks */
    plr_real S[PLR_CALIBRATIONS][PLR_MAX_LD];        /* the error of each row of P by those of the
                                                 calibration, relative: src/state/sensitivity.h */
    plr_held_motion held;
} plr_belief;

/* What velocity and biases do in the same time, with an IMU (docs/MATH.md 19): the velocity becomes V
 * x_d plus noise, its biases only gain noise. Q_nc and Q_cc are the covariances of the noise of
 * velocity and biases with that of n, and with itself. */
typedef struct plr_core_motion {
    plr_real V[PLR_VELOCITY_DIM * PLR_DRIVERS];
    plr_real Q_nc[PLR_POSE_DIM * PLR_REST_DIM];
    plr_real Q_cc[PLR_REST_DIM * PLR_REST_DIM];
} plr_core_motion;

/* Motion that is already in the pose but not yet in the covariance: D = (I + E, p) with
 * xi+ = Ad(D^-1) xi + n, n = B x_d + N(0, Q), docs/MATH.md 4. x_d are the drivers, plr_layout. */
typedef struct plr_motion {
    plr_real E[9], p[3];         /* 3x3 and m */
    plr_real Q[PLR_POSE_SQUARE]; /* 6x6 */
    plr_real B[PLR_MOTION_BY];   /* 6 x drivers, leading dimension PLR_DRIVERS */
    plr_real seconds;            /* duration, for the bias walk of twists */
    uint8_t pending;             /* 1 if any motion is accumulated */
    uint8_t noisy;               /* 0 if it is exact (mapping): Q and B are zero */
    plr_core_motion core;        /* with an IMU */
} plr_motion;

#endif
