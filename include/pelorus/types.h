// SPDX-License-Identifier: MIT
/*
 * The types that filter, wire format and session share: status, pose, twist, IMU reading,
 * observation, landmark, report. Numbers are double here, whatever the filter computes in: every
 * float32 fits exactly.
 *
 * Frames: W world, B body, C left camera (x right, y down, z forward). T_WB = (R_WB, p_WB) brings
 * body coordinates to the world: x_W = R_WB x_B + p_WB. Matrices are row by row.
 */
#ifndef PELORUS_TYPES_H
#define PELORUS_TYPES_H

#include <stdbool.h>
#include <stdint.h>

/* Time in nanoseconds; the zero is the recorder's choice. */
typedef uint64_t plr_time_ns;

/* The result of a call. Errors are negative. After an error the filter is as it was before the
 * call, except for its counts, and for what it remembers of refused IMU readings (filter.h). */
typedef enum plr_status {
    PLR_OK = 0,
    PLR_E_ARGUMENT = -1,    /* a null pointer, a count beyond the capacity, an impossible value */
    PLR_E_CONFIG = -2,      /* a setting is outside its limits or contradicts another;
                               plr_config_check says which */
    PLR_E_CALIBRATION = -3, /* focal length, baseline or T_CB is impossible */
    PLR_E_NOT_FINITE = -4,  /* an input holds NaN or infinity */
    PLR_E_RANGE = -5,       /* an input is larger than allowed, for example pi rad in a step */
    PLR_E_TIME = -6,        /* time repeats or goes back */
    PLR_E_LATE = -7,        /* a frame or a reading is older than the filter's time */
    PLR_E_GAP = -8,         /* time jumps forward by more than the setting max-gap */
    PLR_E_MODE = -9,        /* the call does not belong to the mode in force */
    PLR_E_FULL = -10,       /* no slot is free, or a device is too small for the state */
    PLR_E_EXISTS = -11,     /* a landmark of this id is in the state already */
    PLR_E_DIVERGED = -12,   /* a variance is not positive: no estimate, nothing to save */
    PLR_E_NOT_READY = -13,  /* no init, HEADER or start of an IMU yet */
    PLR_E_CPU = -14,        /* the processor flushes subnormals to zero */
    PLR_E_CORRUPT = -15,    /* stored bytes fail their check */
    PLR_E_FOREIGN = -16,    /* the data was made by another version or build; for a saved state
                               also: with another calibration or other settings */
    PLR_E_IO = -17,         /* the port, a device or a sink reports a failure */
    PLR_E_DAMAGED = -18,    /* something else wrote to the filter's memory: init again */
    PLR_E_SIZE = -19        /* caller and library were compiled with different capacities or
                               precision */
} plr_status;

/* How far the estimate may be trusted. */
typedef enum plr_health {
    PLR_HEALTH_GOOD = 0,     /* no known problem */
    PLR_HEALTH_DEGRADED = 1, /* it works, with a problem: see the reasons */
    PLR_HEALTH_LOST = 2,    /* the pose is predicted from twists or IMU alone (no observation and no
                                position was used for a second or two), vision contradicts it, or
                                the IMU has not started */
    PLR_HEALTH_DIVERGED = 3 /* something else wrote to the filter's memory: init again */
} plr_health;

/* Why health is as it is: bits of plr_report.reasons and plr_health_state.reasons. Those of
 * PLR_REASONS_HARMLESS leave it GOOD if no other is set. Above each: what it means, what causes it, what to do. */
typedef enum plr_reason {
    /* Fewer than 3 observations were used in this frame: a bare wall, darkness, a covered camera, or
     * the gate rejects what is seen. It usually passes; if it stays, check the tracker. */
    PLR_REASON_FEW_OBSERVATIONS = 1 << 0,
    /* None used in the last 10 frames, or for a second: the pose is predicted from twists or IMU
     * alone and drifts, with an IMU within seconds. Causes as above. */
    PLR_REASON_NO_OBSERVATIONS = 1 << 1,
    /* Most matches rejected in 10 successive frames; the landmarks were dropped. The camera was
     * moved, ids changed their meaning, or a sigma is far too small. */
    PLR_REASON_GATE_LOCKED = 1 << 2,
    /* None of the last 1000 matches rejected: gate-d2 or pixel-sigma is too large for the gate to
     * reject an outlier. Health stays GOOD. */
    PLR_REASON_GATE_INERT = 1 << 3,
    /* An innovation covariance could not be factorised; its observations were left out. Numbers of
     * very different size: check pixel-sigma, start-sigma and the covariances that were given. */
    PLR_REASON_BLOCK_FAILED = 1 << 4,
    /* The map sink refused a landmark, which therefore keeps its slot. Make room in the sink. */
    PLR_REASON_SINK_FAILED = 1 << 5,
    /* New landmarks found no slot; health stays GOOD. More slots, or fewer features. */
    PLR_REASON_NO_ROOM = 1 << 6,
    /* Observations were malformed or ids were doubled: a fault of the tracker or of the link. */
    PLR_REASON_REFUSED_INPUT = 1 << 7,
    /* Innovations are larger than the noise explains: pixel-sigma, a twist's sigma or an IMU's
     * noise is too small, or the calibration is off. */
    PLR_REASON_NIS_HIGH = 1 << 8,
    /* An update would have turned a landmark's bearing by more than 1 rad, or put it nearer than
     * 1 cm, and was limited to that: a point beside the camera, or a wrong match that the gate
     * accepted. */
    PLR_REASON_RANGE_LIMITED = 1 << 9,
    /* A variance ceased to be positive, and the filter recovered in the same frame: see RECOVERED.
     * Numbers of very different size: check the sigmas and the covariances that were given. */
    PLR_REASON_NOT_POSITIVE = 1 << 10,
    /* Observations were left out for want of time. A longer deadline, or fewer features. */
    PLR_REASON_BUDGET = 1 << 11,
    /* Pictures and odometry (twists or IMU) differ by more than is usual on this drive: slipping wheels, a
     * dead encoder, a push, a camera that was knocked. If they agreed before and the difference is a good
     * part of the motion, the pictures are followed (totals.contradictions). If it repeats, check the wheels;
     * if it stays, the scale of the odometry, and in bends the camera's place on the body; or the clocks of
     * camera and odometry differ (camera-offset). */
    PLR_REASON_TWIST_CONTRADICTED = 1 << 12,
    /* After GATE_LOCKED, TWIST_CONTRADICTED, RECOVERED, RELOCATED or MAP_DISAGREES: the pose may be
     * wrong by more than its covariance says. Ends when twists, or the IMU, have agreed with vision
     * for a while, or when the pose is set. Also for two seconds after an IMU's start in motion
     * (setting imu-start). Drive with care until then. */
    PLR_REASON_POSE_MAY_BE_WRONG = 1 << 13,
    /* A bias estimate lies further from its prior's mean than the prior allows: 4.2 sigma of the
     * difference that is to be expected of an estimate as certain as this one. With twists: stereo
     * and odometry disagree in scale (baseline, focal length, wheel radius; which of them cannot be
     * known), or bias-*-sigma is too small. With an IMU: bias-accel-sigma or bias-gyro-sigma is too
     * small, the biases in a START are wrong, or the camera's place on the body is. */
    PLR_REASON_BIAS_OFF_PRIOR = 1 << 14,
    /* Innovations are far smaller than the noise says, over many frames: pixel-sigma is too large,
     * or the tracker smooths what it sees. The pose is better than its covariance says. Health stays
     * GOOD. */
    PLR_REASON_NIS_LOW = 1 << 15,
    /* The same pixels in successive frames while twists or IMU report motion: a camera or tracker
     * that sends the same image again. Restart it. */
    PLR_REASON_FROZEN_IMAGE = 1 << 16,
    /* Bit 17 was SCENE_DISAGREES, and is free. */
    /* After a divergence the landmarks were dropped and the pose's covariance was enlarged, so that
     * the filter can continue. Reported once; the reset counter of POSE and ODOMETRY counts it. */
    PLR_REASON_RECOVERED = 1 << 18,
    /* No frame came for more than a second: camera, tracker or link are silent. Only
     * plr_filter_health says so, because a plr_report exists only where there is a frame. */
    PLR_REASON_NO_FRAMES = 1 << 19,
    /* The filter's memory changed between two calls: a stray write, a flipped bit, a stack that
     * grew into it. Call plr_filter_init; if it comes again, search for the code that writes
     * there. */
    PLR_REASON_STATE_DAMAGED = 1 << 20,
    /* Twists, or IMU readings, are missing or refused, or the last one is too old. Check the
     * odometry, or the IMU, and its link; plr_filter_imu_fault says what is wrong with an IMU. */
    PLR_REASON_NO_TWISTS = 1 << 21,
    /* Readings of a small sensor (plr_sensor) were rejected ten times in succession, or differ from the
     * estimate by more than their sigma says for longer than by chance; a position counts for less
     * meanwhile. The sensor or the estimate is wrong: check the sensor's frame, lever arm, clock, units
     * and sigma. */
    PLR_REASON_READINGS_REJECTED = 1 << 22,
    /* With an IMU: the filter has not started, because tilt and velocity are not known yet. Let the
     * body stand for a second, or see the setting imu-start. */
    PLR_REASON_NOT_STARTED = 1 << 23,
    /* IMU readings are refused (saturated, repeated without end, spikes) or do not fit gravity:
     * check units (m/s^2, rad/s), signs, axes and range of the sensor. */
    PLR_REASON_IMU_FAULT = 1 << 24,
    /* In ten frames nearly all known landmarks lay elsewhere than the pose said, but they agree on another
     * pose: the filter began anew there, and dropped all other landmarks without handing them to the sink.
     * Wheels slipped for long, the robot was carried, or the pose that was set was wrong. Reported once;
     * the reset counter of POSE and ODOMETRY counts it. */
    PLR_REASON_RELOCATED = 1 << 25,
    /* A map that came in sight moved the pose by more than the covariances of both allow: the map is off as
     * a whole, its covariances are too small, or the pose that was set was wrong. Told in that frame;
     * POSE_MAY_BE_WRONG stays, and the covariance covers the poses before and after, until pictures and
     * twists have agreed for a while. */
    PLR_REASON_MAP_DISAGREES = 1 << 26,
    /* All along this drive pictures and odometry differ by more than twice their sigmas. Weights and health
     * count in units of what is usual, so health stays GOOD; but the sigmas are too small: velocity-sigma
     * and gyro-sigma for odometry whose errors last longer than a reading, gyro-noise and accel-noise for an
     * IMU; or the calibration is off. `pelorus check` measures them. */
    PLR_REASON_NOISE_MISFIT = 1 << 27,
    /* A part of the calibration that was estimated (setting calibrate) would have moved by more than four
     * sigmas of what was learnt of it. So something else is wrong, and it was put back to what init was
     * told, is considered from then on, and the rest is learnt anew: plr_calibration_result.estimated says
     * which it is. The accelerometer's scale looks like a baseline, its axes like a turned camera, a clock
     * like either; or the calibration is off by many of its sigmas: then enlarge the sigma, or calibrate. */
    PLR_REASON_CALIBRATION_OFF = 1 << 28
} plr_reason;

/* Reasons that leave health GOOD: the estimate is as good as it should be, and the settings could be
 * better. */
enum {
    PLR_REASONS_HARMLESS = PLR_REASON_GATE_INERT | PLR_REASON_NO_ROOM | PLR_REASON_NIS_LOW |
                           PLR_REASON_NOISE_MISFIT | PLR_REASON_CALIBRATION_OFF
};

/* What is wrong with an IMU: plr_filter_imu_fault. Before its start the filter waits for better
 * readings. After a start from a given state, faults 2 to 6 are found within ten seconds, from the
 * mean of the readings, and the filter goes on. Readings with one of the last four are refused. */
typedef enum plr_imu_fault {
    PLR_IMU_FAULT_NONE = 0,
    PLR_IMU_FAULT_MOVES = 1,       /* at the start: the body does not stand still */
    PLR_IMU_FAULT_TURNS = 2,       /* the gyro turns and the accelerometer does not: degrees
                                      instead of rad, or a bias beyond bias-gyro-sigma */
    PLR_IMU_FAULT_IN_G = 3,        /* the mean specific force is about 1: g instead of m/s^2 */
    PLR_IMU_FAULT_NOT_GRAVITY = 4, /* it is far from the setting gravity: scale, or a broken axis */
    PLR_IMU_FAULT_UPSIDE_DOWN = 5, /* it points down in the pose that was set: a wrong sign */
    PLR_IMU_FAULT_TILT = 6,        /* it points elsewhere than the pose that was set: axes swapped,
                                      or a wrong pose. A start at rest uses the measured tilt */
    PLR_IMU_FAULT_SATURATED = 7,   /* at the setting gyro-range or accel-range */
    PLR_IMU_FAULT_FROZEN = 8,      /* the same numbers again and again */
    PLR_IMU_FAULT_SPIKE = 9,       /* a single reading far from its neighbours */
    PLR_IMU_FAULT_NOT_FINITE = 10, /* NaN or infinity */
    PLR_IMU_FAULTS
} plr_imu_fault;

/* A rigid motion x -> R x + p. */
typedef struct plr_pose {
    double R[9]; /* rotation, row by row */
    double p[3]; /* m */
} plr_pose;

/* Velocity of the body in its own axes. */
typedef struct plr_twist {
    double v_B_mps[3];
    double w_B_radps[3];
} plr_twist;

/* One reading of an IMU. Its axes are the body's, unless the setting imu_turn says otherwise. */
typedef struct plr_imu {
    double a_B_mps2[3];  /* specific force: at rest 9.81 upwards */
    double w_B_radps[3]; /* angular rate */
} plr_imu;

/* uR_px and vR_px of a point that the left picture alone shows. */
#define PLR_NOT_SEEN_PX (-1e9F)

/* One landmark in a rectified stereo pair, or in its left picture alone: that tells its bearing, and begins no
 * landmark. */
typedef struct plr_observation {
    uint32_t id; /* equal ids in different frames mean the same point; the tracker may reuse the id
                    of a point that has left the filter */
    float uL_px, vL_px, uR_px, vR_px;
    float sigma_px; /* of each of these coordinates, 1e-3 to 1e3; 0: the setting pixel-sigma */
} plr_observation;

/* No limit on the observations of a frame. */
enum { PLR_NO_BUDGET = 65535 };

/* A sensor that measures one to three numbers directly. */
typedef enum plr_sensor {
    PLR_SENSOR_WHEEL = 1,      /* the velocity of a point of the body, along the body's axes */
    PLR_SENSOR_STANDSTILL = 2, /* the body does not move */
    PLR_SENSOR_POSITION = 3,   /* the position of a point of the body in the world: GNSS, motion
                                  capture, a beacon */
    PLR_SENSORS = 3            /* kinds are 1 to this */
} plr_sensor;

/* One reading of such a sensor. */
typedef struct plr_reading {
    plr_time_ns t_ns;
    uint8_t sensor;   /* plr_sensor */
    uint8_t axes;     /* bits 0 to 2: which of the three numbers were measured; 1 to 7 */
    double value[3];  /* wheel: velocity of the point at_B_m in body axes, m/s; standstill: zeros;
                         position: of that point in the world, m */
    double sigma[3];  /* standard deviation of each, in the same unit; above 0 where axes has the
                         bit. Standstill: [0] of the velocity, m/s, [1] of the rate, rad/s */
    double at_B_m[3]; /* where on the body the sensor is, in body axes */
} plr_reading;

/* What became of a reading. */
typedef struct plr_reading_result {
    plr_status status;
    bool used; /* false: the gate rejected it */
    double d2; /* r^T S^-1 r: the squared distance from its prediction, in sigmas */
} plr_reading_result;

/* All observations of one stereo pair. */
typedef struct plr_frame {
    plr_time_ns t_ns;
    uint16_t budget; /* most observations that may be used; PLR_NO_BUDGET: all */
    uint16_t count;  /* observations, at most PLR_MAX_OBSERVATIONS */
    const plr_observation *observations;
} plr_frame;

/* A landmark in the world. */
typedef struct plr_landmark {
    uint32_t id;
    uint32_t times_seen;
    uint32_t times_gated;
    plr_time_ns last_seen_ns;
    bool known; /* given by a map source or plr_filter_insert_known */
    double p_W_m[3];
    double P_W_m2[9]; /* 3x3 covariance of p_W_m, including the uncertainty of the pose */
} plr_landmark;

/* A rectified stereo camera and its place on the body. */
typedef struct plr_calibration {
    double fx_px, fy_px, cx_px, cy_px;
    double baseline_m;
    plr_pose T_CB; /* body to left camera: a point s_B of the body is R s_B + p in the camera */
} plr_calibration;

/* What may be wrong in it: two shares, and the rest in the left camera's axes. */
typedef enum plr_calibration_error {
    PLR_BASELINE,
    PLR_FOCAL_LENGTH,
    PLR_CAMERA_TURN_X, /* T_CB <- Exp(0, turn) T_CB, rad */
    PLR_CAMERA_TURN_Y,
    PLR_CAMERA_TURN_Z,
    PLR_CENTRE_X, /* px */
    PLR_CENTRE_Y,
    PLR_CAMERA_PLACE_X, /* T_CB <- Exp(place, 0) T_CB, m */
    PLR_CAMERA_PLACE_Y,
    PLR_CAMERA_PLACE_Z,
    PLR_CAMERA_CLOCK, /* to be added to the time of a frame, s */
    PLR_WHEEL_SCALE, /* of wheels beside an IMU: the share by which their speed is more than they read */
    PLR_WHEEL_TRACK, /* the same of their distance from each other */
    PLR_CALIBRATION_ERRORS
} plr_calibration_error;

/* The calibration as the filter has estimated it: plr_filter_calibration. */
typedef struct plr_calibration_result {
    plr_time_ns t_ns;
    uint16_t estimated;     /* bits 1 << plr_calibration_error: the others are as given to init */
    plr_calibration camera; /* with all corrections; the clock's goes to camera-offset */
    double corrected[PLR_CALIBRATION_ERRORS]; /* by how much, since init or reset */
    double sigma[PLR_CALIBRATION_ERRORS];     /* what may be left; 0: taken for exact */
} plr_calibration_result;

/* What happened to one stereo frame. */
typedef struct plr_report {
    plr_time_ns t_ns;
    plr_status status;
    plr_health health;
    uint32_t reasons;       /* bits of plr_reason */
    uint16_t budget;        /* as given in the frame */
    uint16_t observations;  /* in the frame */
    uint16_t matched;       /* observations of landmarks that are in the state */
    uint16_t used;          /* matched, accepted by the gate, and applied in the update */
    uint16_t gated;         /* matched, and rejected by the gate */
    uint16_t created;       /* new landmarks, and known ones that came in or came in again */
    uint16_t evicted;       /* landmarks handed to the map sink to make room; not those dropped */
    uint16_t refused;       /* observations that are not finite or outside any image */
    uint16_t duplicates;    /* observations whose id occurs more than once in the frame: all of
                               them are refused */
    uint16_t no_room;       /* new ids for which no slot was free */
    uint16_t poor;          /* new ids refused by min_disparity_px, depth or row gap; in
                               localization, ids that the map does not know; all new ids of a
                               frame that rejects nearly all that it matched */
    uint16_t left_out;      /* accepted by the gate, but more than the budget allows */
    uint16_t blocks_failed; /* blocks whose innovation covariance could not be factorised */
    uint16_t active;        /* landmarks in the state after the frame */
    uint16_t nis_dof;       /* degrees of freedom of nis: 4 for each accepted observation */
    float nis;              /* sum of d^2, the squared Mahalanobis distances, over all observations
                               that the gate accepted, within the budget or not; its expected value
                               is nis_dof (docs/MATH.md 8) */
    uint16_t innovation_rows; /* rows of all that was applied: 3 for each observation used, and
                               those of the biases */
    float innovation_d2;      /* y^T S^-1 y of these rows together, y the innovation and S its
                               covariance as the filter believed it; its expected value is
                               innovation_rows */
    float innovation_log_det; /* ln det S. d2 + log_det + rows ln(2 pi) is -2 ln of the likelihood:
                               of two settings the better one has the smaller sum over a drive */
} plr_report;

/* Whether the pose is in doubt: docs/SUPERVISION.md. "Odometry" stands for twists and for an IMU. */
typedef enum plr_doubt {
    PLR_DOUBT_NONE,
    PLR_DOUBT_DEPARTED, /* odometry and pictures differ by more than is usual; both keep their weight */
    PLR_DOUBT_CONTRADICTED, /* the odometry has lost weight, and the pictures are followed */
    PLR_DOUBT_SETTLING      /* until both have agreed for a while */
} plr_doubt;

/* Why a landmark that was seen has not been used. */
typedef enum plr_rejection {
    PLR_REJECTED_BY_GATE = 1, /* further off than the gate allows */
    PLR_REJECTED_FAR = 2,     /* by so much that another point is seen: the track was lost */
    PLR_REJECTED_MOVES = 4    /* its innovations are no white noise: the point moves */
} plr_rejection;

typedef struct plr_rejected_landmark {
    uint32_t id;
    uint8_t why;            /* plr_rejection */
    uint16_t in_succession; /* frames that rejected it */
    float
        mean2; /* its innovations' sum beside white noise: chi-square of three, above 36 it moves */
} plr_rejected_landmark;

enum { PLR_SUPERVISION_REJECTED = 24 };

/* What the supervisor saw in one frame, and what it decided: plr_filter_supervision. */
typedef struct plr_supervision {
    plr_time_ns t_ns;
    float nu[6];         /* pictures less odometry, in the odometry's stated sigmas: (rho, theta) */
    float moved[6];      /* what the frame moved the pose beside odometry: m and rad, in the body */
    float statistic;     /* chi-square of six of the sum of nu, in units of what is usual */
    float usual[6];      /* by how much its square is usually more than stated, 1 to 25 */
    float agreement;     /* share of the last frames in which both agreed */
    float weight;        /* factor of the odometry's sigmas in the next frame, 1 or more */
    float difference[6]; /* from the other pose that may be true: m and rad, in the body */
    uint8_t doubt;       /* plr_doubt */
    bool applied;        /* the frame applied a motion: nu and moved are filled */
    bool outright;       /* the points agreed on a motion that the odometry excludes */
    bool waits;          /* the frame was not used: the next one shall confirm it */
    bool holds_biases;   /* it taught the biases nothing */
    bool locked;         /* the landmarks that the gate rejected were dropped */
    bool frozen;         /* the picture repeats the last one, and was not used */
    bool misfits;        /* `usual` is more than the stated sigmas allow */
    bool settled;        /* a doubt ended: the difference was added to the covariance */
    uint16_t matched;    /* observations of ids in the state */
    uint16_t same;       /* of these, with the very pixels of last time */
    uint16_t known;      /* known landmarks in the frame */
    uint16_t adopted;    /* of these, that have just come in */
    uint8_t count;       /* of `rejected`: those of the largest mean2, if there are more */
    plr_rejected_landmark rejected[PLR_SUPERVISION_REJECTED];
} plr_supervision;

/* The filter's health at some time, with or without a frame: plr_filter_health. A time since an
 * event that never happened is infinite; the reasons then hold NO_FRAMES, NO_OBSERVATIONS or
 * NO_TWISTS. */
typedef struct plr_health_state {
    plr_health health;
    uint32_t reasons;             /* bits of plr_reason */
    double seconds_without_frame; /* since the last accepted frame */
    double seconds_without_use;   /* since the last observation that was used */
    double seconds_without_twist; /* since the last accepted twist or IMU reading */
    uint32_t resets; /* times the pose may have jumped: it was set by a call, or its covariance was
                        enlarged; the reset counter of a POSE */
} plr_health_state;

#endif
