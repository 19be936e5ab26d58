// SPDX-License-Identifier: MIT
/*
 * The supervisor: whether odometry, pictures, a known map and small sensors agree with each other, and what
 * follows from it. The estimator (src/filter) hands it evidence at three points of a frame, and carries
 * out what it decides; the supervisor itself sees no covariance of the state and changes no estimate
 * (docs/SUPERVISION.md). "Odometry" stands for twists as well as for an IMU.
 */
#ifndef PELORUS_SUPERVISOR_H
#define PELORUS_SUPERVISOR_H

#include <stdbool.h>
#include <stdint.h>

#include "pelorus/config.h"
#include "pelorus/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The time of what has not been yet. */
#define PLR_NEVER_NS UINT64_MAX

/* ---------------------------------------------------------------- evidence */

/* Before the search: does the picture show the present? */
typedef struct plr_picture_evidence {
    bool
        may_repeat; /* false in the model `world`, where a picture that repeats is used all the same */
    unsigned matched, same; /* matched observations; of these, with the very pixels of last time */
    plr_real moved[PLR_POSE_DIM];    /* the motion by odometry since the last frame, m and rad */
    plr_real variance[PLR_POSE_DIM]; /* of its noise */
} plr_picture_evidence;

/* After the search and the gate. */
typedef struct plr_search_evidence {
    unsigned matched, gated;
    bool outright; /* the points agree on a motion that the odometry excludes */
    plr_time_ns now_ns;
} plr_search_evidence;

/* The motion of a frame, by pictures beside odometry. */
typedef struct plr_motion_evidence {
    bool applied; /* there is one; else nothing below is filled */
    bool
        outright; /* the points agreed on a motion that the odometry excludes, and that one was applied */
    plr_real E[9], p[3];          /* the motion that was applied: (I + E, p) */
    plr_real moved[PLR_POSE_DIM]; /* by how much the frame moved the pose beside odometry: m, rad */
    plr_real L[PLR_POSE_SQUARE];  /* sigmas of the odometry as stated: lower triangle, 6x6 */
    plr_real weight;              /* the factor of these that the frame used: 1 or more */
    plr_real nu[PLR_POSE_DIM];    /* pictures less odometry, in units of L */
    /* its information, prior included, in units of weight L: packed upper triangle */
    plr_real Lambda[PLR_POSE_TRIANGLE];
} plr_motion_evidence;

/* What a frame with known landmarks did to the pose; covariances 6x6 of (rho, theta). */
typedef struct plr_map_evidence {
    unsigned known, adopted; /* known landmarks in the frame; of these, that have just come in */
    plr_real R_WB[9];
    plr_real moved[PLR_POSE_DIM]; /* the correction, m and rad in the body */
    plr_real P_before[PLR_POSE_SQUARE], P_after[PLR_POSE_SQUARE];
    plr_real calibration[PLR_POSE_SQUARE]; /* the part of it that the camera's calibration causes */
} plr_map_evidence;

/* What the sensors send, at some time. */
typedef struct plr_readings_evidence {
    plr_time_ns now_ns;
    plr_time_ns reading_ns;       /* of the last twist or IMU reading */
    plr_real interval_s;          /* between the last two */
    bool valid;                   /* there is one */
    bool needed;                  /* false in mapping, where poses are given */
    bool looks;                   /* false in dead reckoning, where no picture is used */
    bool imu, started, unsettled; /* an IMU; it has started; its start is not settled yet */
    bool fault_of_start;          /* it has a fault that its start has shown */
    bool fault_of_reading;        /* a reading was refused for a fault, and may come right again */
    uint32_t refused;             /* twists or IMU readings refused so far */
} plr_readings_evidence;

/* Events of a frame. */
typedef struct plr_frame_events {
    bool sink_failed;
    bool locked;    /* the gate rejected nearly all for ten frames: its landmarks were dropped */
    bool recovered; /* a variance was not positive: the landmarks were dropped */
    bool relocated; /* the pose was found anew in a known map */
    bool left_out;  /* known landmarks in sight have not come in; they must not be born as others */
    bool lost_in_map; /* they fit no pose */
    bool moved_far;   /* the pose was moved to where they see it, beyond its covariance: */
    plr_real far_xi[PLR_POSE_DIM], far_nu[PLR_POSE_DIM]; /* by so much, m and rad; in sigmas */
    unsigned adopted, unplaced; /* known landmarks that came in; that could not */
    unsigned cut;               /* landmark corrections limited */
    bool miscalibrated;         /* a part of the calibration is refused */
} plr_frame_events;

/* The biases beside their prior. */
typedef struct plr_bias_evidence {
    bool estimated;
    plr_real off[PLR_BIAS_DIM], prior[PLR_BIAS_DIM], variance[PLR_BIAS_DIM]; /* variances */
} plr_bias_evidence;

/* At the end of a frame. */
typedef struct plr_frame_evidence {
    plr_picture_evidence picture;
    plr_motion_evidence motion;
    plr_map_evidence map;
    plr_bias_evidence bias;
    plr_frame_events events;
    plr_readings_evidence readings;
    bool has_gate;
} plr_frame_evidence;

/* ---------------------------------------------------------------- decisions */

/* Before the search, for all of the frame; again where the filter begins anew in it. */
typedef struct plr_picture_decision {
    bool use;        /* false: the picture does not show the present, and nothing of it is used */
    plr_real weight; /* a factor of the odometry's sigmas, 1 or more */
    bool may_exclude_odometry; /* points may agree on a motion that the odometry excludes */
    bool opens_fixed_gate;     /* a gate of fixed width would reject everything for ever */
} plr_picture_decision;

typedef struct plr_search_decision {
    bool wait;          /* use nothing of this frame: the next one shall confirm it */
    bool hold_biases;   /* the frame teaches the biases nothing */
    bool drop_rejected; /* the gate is locked: drop the landmarks that it rejected */
    bool make_none;     /* make no landmarks: the pose is probably wrong */
} plr_search_decision;

/* What is handed on through the stages of a frame. */
typedef struct plr_decisions {
    plr_picture_decision picture;
    plr_search_decision search;
} plr_decisions;

typedef struct plr_frame_decision {
    plr_health health;
    uint32_t reasons;
    bool contradicted_now; /* from this frame on pictures are followed against the odometry */
    bool covers;           /* add `cover` to the pose's covariance for good: it may have jumped */
    plr_real cover[PLR_POSE_SQUARE];
} plr_frame_decision;

/* ---------------------------------------------------------------- the state */

/* A sum of differences in which older ones count less, and the covariance that it should have. */
typedef struct plr_sum {
    plr_real sum[PLR_POSE_DIM];
    plr_real variance[PLR_POSE_TRIANGLE]; /* 6x6, packed upper triangle */
} plr_sum;

/* The readings of a small sensor beside what was expected of them. */
typedef struct plr_sensor_record {
    plr_time_ns t_ns;  /* of the last reading that was used or rejected */
    double value[3];   /* its numbers */
    plr_real excess;   /* sum of d^2 less its expectation, older ones weighted less */
    plr_real numbers;  /* the same of that expectation */
    uint16_t rejected; /* in succession */
    uint8_t off;       /* 1: they differ by more than their sigma says, and not by chance */
} plr_sensor_record;

/* All that the supervisor remembers: one block of the saved filter. */
typedef struct plr_supervisor {
    uint64_t left_out; /* bits of plr_limit_id: rules that are left out, for measurements */
    uint8_t scene;     /* the setting: plr_scene_policy */
    uint8_t slips;     /* 1: the odometry is twists, which slip; an IMU does not */

    /* odometry */
    plr_sum sum; /* of nu, in the odometry's sigmas */
    plr_real
        usual[PLR_POSE_DIM]; /* its mean square on this drive, in units of its variance: >= 1 */
    uint8_t misfits;         /* 1: that is more than the stated sigmas allow */
    plr_real usual_frames;   /* from which that was learnt */
    plr_real statistic;      /* chi-square of the sum in units of what is usual */
    plr_real agreement;      /* share of the last frames in which both agreed */
    plr_real weight;         /* factor of the odometry's sigmas in the next frame: 1 or more */
    plr_real difference[PLR_POSE_DIM]; /* from the pose by odometry to that by pictures: m, rad */
    plr_real difference_sigmas[PLR_POSE_DIM];
    plr_real difference_noise; /* the expected square of difference_sigmas by noise alone */
    uint8_t doubt;             /* plr_doubt */
    uint8_t waits, holds_biases, settled; /* what the last frame did: plr_supervision */
    uint8_t outright;        /* the last frame contradicted outright, and waits for the next */
    plr_time_ns outright_ns; /* since when */
    uint8_t relocated;       /* the pose was found anew since it came into doubt */
    uint8_t settle_frames;   /* frames of agreement that end the doubt */
    /* in succession: */
    uint16_t agreeing_frames, contradicting_frames, doubted_frames;

    /* pictures */
    plr_real frozen_motion[PLR_POSE_DIM]; /* by odometry since the picture was new, m and rad */
    plr_real frozen_variance[PLR_POSE_DIM];
    plr_real nis, nis_dof; /* sums over frames, older ones weighted less */
    uint32_t matches_since_gated;
    uint16_t frames_without_use, frames_mostly_gated;
    uint8_t frozen;

    /* a known map that has come in sight */
    plr_real map_moved[PLR_POSE_DIM]; /* sum of the corrections, in the world's axes */
    plr_real map_variance[PLR_POSE_SQUARE];
    uint8_t map_frames; /* that are still to be summed up */

    /* health */
    uint8_t health;
    uint32_t reasons;
    uint32_t refused_before; /* readings refused until the last frame */
    plr_time_ns last_frame_ns, last_use_ns, last_position_ns;

    plr_sensor_record sensors[PLR_SENSORS];
} plr_supervisor;

/* ---------------------------------------------------------------- its thresholds */

/* Every threshold of detection: limits.def has value, unit, reason, and what needs it. First the rules, which
 * plr_filter_leave_out can leave out, then the numbers that belong to one of them. */
typedef enum plr_limit_id {
#define LIMIT(name, value, off, unit, about, scenario, recording) PLR_LIMIT_##name,
#define PART(name, value, unit, about, rule)
#include "pelorus/limits.def"
#undef LIMIT
#undef PART
    PLR_RULES,
    PLR_LAST_RULE = PLR_RULES - 1,
#define LIMIT(name, value, off, unit, about, scenario, recording)
#define PART(name, value, unit, about, rule) PLR_LIMIT_##name,
#include "pelorus/limits.def"
#undef LIMIT
#undef PART
    PLR_LIMITS
} plr_limit_id;

typedef struct plr_limit_row {
    const char *name, *unit, *about, *scenario, *recording;
    const char *rule;  /* to which it belongs; NULL: it is a rule itself */
    double value, off; /* as it is; as it is where the rule is left out */
} plr_limit_row;

/* Row 0 to PLR_LIMITS - 1, by plr_limit_id; NULL beyond. */
const plr_limit_row *plr_limit_at(unsigned row);

#ifdef __cplusplus
}
#endif

#endif
