// SPDX-License-Identifier: MIT
/*
 * The memory of a filter. It is public so that a caller can reserve it statically; the fields are
 * for the library alone, and their layout may change with any version. plr_map and plr_totals,
 * which come first, are part of the interface.
 */
#ifndef PELORUS_STATE_H
#define PELORUS_STATE_H

#include <stddef.h>

#include "pelorus/camera.h"
#include "pelorus/config.h"
#include "pelorus/settings.h"
#include "pelorus/supervisor.h"
#include "pelorus/types.h"

/* The caller's store of landmarks outside the filter. Both functions may be NULL. They must not
 * call the filter. */
typedef struct plr_map {
    void *context;
    /* Stores a landmark that leaves the filter. Returns 0; else the filter keeps it. */
    int (*sink)(void *context, const plr_landmark *landmark);
    /* Looks up an id: fills position, covariance and id and returns true, or returns false. A frame may ask
     * for an id several times, and for those of known landmarks that it does not see. */
    bool (*source)(void *context, uint32_t id, plr_landmark *landmark);
} plr_map;

/* Counts since init or reset. */
typedef struct plr_totals {
    uint32_t twists;        /* accepted; with an IMU its readings, as in twists_refused */
    uint32_t frames;        /* accepted */
    uint32_t late;          /* frames and readings refused with PLR_E_LATE */
    uint32_t refused;       /* other calls refused because of their data */
    uint32_t resets;        /* poses set by plr_filter_set_pose */
    uint32_t locks;         /* times the gate rejected nearly everything: PLR_REASON_GATE_LOCKED */
    uint32_t range_limited; /* landmark corrections limited: PLR_REASON_RANGE_LIMITED */
    uint32_t blocks_failed; /* as in plr_report */
    uint32_t widened;       /* times the pose's covariance was enlarged: the pose may have jumped */
    uint32_t recoveries;    /* times the landmarks were dropped after a divergence */
    uint32_t contradictions; /* times the filter followed vision against twists or IMU */
    uint32_t twists_refused, frames_refused;             /* for any reason */
    uint32_t damaged;                                    /* frames refused with PLR_E_DAMAGED */
    uint32_t readings, readings_gated, readings_refused; /* of small sensors */
    uint64_t observations, matched, used, gated, created, evicted;
    plr_time_ns diverged_ns; /* when a variance was last found not positive; 0: never */
} plr_totals;

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

/* Where a point was in the left picture when the average below began. */
typedef struct plr_watched_point {
    uint32_t id;
    float u_px, v_px;
    uint32_t used; /* 0: a free place; else what is known of it, plr_point_watch */
} plr_watched_point;

enum { PLR_WATCHED_POINTS = 8 };

/* What is known of a watched point. */
typedef enum plr_point_watch {
    PLR_POINT_FILLED = 1,
    PLR_POINT_CONFIRMED = 2, /* seen again where it was */
    PLR_POINT_MOVED = 4,     /* seen elsewhere last time */
    PLR_POINT_EARLY = 8,     /* first seen in the first half of the stretch */
    PLR_POINT_STAYS = 16     /* seen where it was in the second half */
} plr_point_watch;

enum { PLR_POINTS_LEAST = 3 }; /* fewer say nothing of the body */

/* Readings of an IMU before the filter has started: src/process/alignment.h. */
typedef struct plr_alignment {
    plr_time_ns begin_ns,
        first_ns; /* of the stretch that is being averaged; of the first reading */
    uint32_t count;
    plr_real mean[PLR_POSE_DIM];      /* (a, w) over the stretch, m/s^2 and rad/s */
    plr_real half_mean[PLR_POSE_DIM]; /* over its first half */
    plr_real spread2[2];              /* sums of squares about the mean, linear and angular */
    plr_watched_point points[PLR_WATCHED_POINTS];
    uint8_t seen_to_move; /* 1: the pictures have shown that the body moves */
} plr_alignment;

/* What a start in motion has left of position and yaw (docs/MATH.md 19, the anchor). */
typedef enum plr_anchored {
    PLR_ANCHOR_DUE, /* the world is free, and will be laid anew */
    PLR_ANCHORED,   /* both are fixed: by the start, or by the anchor after it */
    /* The world was given by a covariance, a measured position or a map: the anchor will widen their
     * variances by what the first second may have misled them. */
    PLR_WORLD_IS_GIVEN
} plr_anchored;

/* What an IMU adds to the state: src/process/imu.c. How readings usually come, `slow` to
 * `off_usual2`, is kept of twists, too: src/process/statistics.h. */
typedef struct plr_inertial {
    plr_real slow[PLR_POSE_DIM]; /* mean reading of the last half second */
    plr_real spread2[2]; /* mean square difference of readings from `slow`, linear and angular */
    plr_real change2[2]; /* mean square of the difference between successive readings */
    plr_real change[PLR_POSE_DIM]; /* the last of these differences */
    plr_real scatter2[2];          /* variance of a reading about the line through its neighbours */
    plr_real usual_s;              /* usual interval between readings */
    plr_real off_usual2;           /* mean square difference of intervals from that, s^2 */
    plr_time_ns started_ns;
    plr_time_ns still_ns;   /* of the last standstill that was measured */
    plr_time_ns doubted_ns; /* since when the mean reading has not fitted gravity: `doubts` */
    uint16_t repeated;      /* successive readings of the same numbers */
    uint16_t out_of_line;   /* successive readings refused as spikes */
    uint16_t frames;        /* that used observations since the start, up to the anchor */
    uint8_t started;        /* 1: tilt and velocity are known */
    uint8_t pose_given;     /* 1: plr_filter_set_pose was called */
    uint8_t anchored;       /* plr_anchored: what is known of position and yaw since the start */
    uint8_t fault;          /* plr_imu_fault, found at the start or since */
    uint8_t doubts;         /* successive frames at which the mean reading did not fit gravity */
} plr_inertial;

/* A velocity that a small sensor measured: z = M (v, w) + noise. It holds until its next reading;
 * src/process/velocity.h. */
typedef struct plr_held_velocity {
    plr_time_ns t_ns, until_ns; /* of the reading; when it ceases to hold */
    plr_time_ns interval_ns;    /* since the reading before it; 0: not known */
    plr_real z[PLR_ROWS];
    plr_real M[PLR_ROWS * PLR_POSE_DIM];
    plr_real density[PLR_ROWS]; /* variance times the seconds between readings */
    uint8_t known;              /* 0: no reading yet */
} plr_held_velocity;

enum { PLR_HELD_VELOCITIES = 3 }; /* a wheel's; a standstill's v, and its w */

typedef struct plr_velocities {
    plr_held_velocity held[PLR_HELD_VELOCITIES];
    /* Information Lambda db = eta about the biases since the last correction. */
    plr_real bias_Lambda[PLR_POSE_SQUARE];
    plr_real bias_eta[PLR_BIAS_DIM];
} plr_velocities;

/* The errors of the calibration that have a column of S: first those that are estimated, then those
 * that are considered. */
typedef struct plr_error_columns {
    uint8_t kind[PLR_CALIBRATIONS]; /* plr_calibration_error */
    uint8_t count, estimated;
    plr_real variance[PLR_CALIBRATIONS]; /* of the prior */
} plr_error_columns;

/* What has become of the calibration: src/state/calibration.h. */
typedef struct plr_camera_estimate {
    plr_camera eye; /* the camera as estimated; R_CB, t_CB: from the axes that `given` gives it to
                       where it was at the time of the last frame */
    plr_real R[9], t[3];               /* the same without the clock's part */
    plr_real twist[PLR_POSE_DIM];      /* of the camera at the last frame, m/s and rad/s */
    plr_real mean_twist[PLR_POSE_DIM]; /* the mean of it over the offset of the camera's clock */
    plr_real rate[3], rate_variance;   /* of the gyro, smoothed, bias included, rad/s; of an axis */
    /* Of the process, the last one first: seconds, and the rate, bias included, rad/s. */
    plr_real step[PLR_CLOCK_STEPS][4];
    uint32_t moves; /* 0: by all that is known the body rests, and nothing is learnt */
    plr_real moved[PLR_CALIBRATIONS];  /* by how much each has been corrected */
    uint8_t misfits[PLR_CALIBRATIONS]; /* frames that would have moved each too far; 10: refused */
    /* Of the errors' covariance G D G^T: G, a lower triangle of ones on its diagonal, row k the column
     * of error k; and D beside the prior's variances. */
    plr_real factor[PLR_CALIBRATIONS * PLR_CALIBRATIONS], told[PLR_CALIBRATIONS];
    /* By twists: what successive frames say of each, summed up, older ones weighted less; the variance
     * of that sum if their errors are white; and its mean square beside that variance. */
    plr_real sum[PLR_CALIBRATIONS], sum_variance[PLR_CALIBRATIONS], usual[PLR_CALIBRATIONS];
    plr_real usual_frames; /* from which that was learnt */
    plr_real excess; /* the largest that is usual, 1 or more: what is learnt counts 1/excess */
} plr_camera_estimate;

/* What the settings make of the gate and of pauses. */
typedef struct plr_parameters {
    plr_real gate_d2, gate_residual2;
    plr_time_ns max_gap_ns;
} plr_parameters;

/* The camera: what init was given, and from `estimate` on what has become of it. Of sigmas the squares. */
typedef struct plr_camera_model {
    plr_camera given;
    plr_real Ad_CB[PLR_POSE_SQUARE]; /* Ad(T_CB): body twists to the camera */
    plr_real pixel_variance;         /* px^2 */
    plr_real track_drift_variance;   /* by which tracks wander in a second, px^2/s */
    plr_real min_disparity, max_row_gap;
    plr_real min_depth, max_depth, min_inverse_range;
    plr_real landmark_variance; /* of a new landmark, m^2; 0: by the pixels' */
    uint8_t landmark_prior;     /* plr_landmark_prior, of a new landmark in `world` */
    plr_error_columns errors;
    plr_camera_estimate estimate;
} plr_camera_model;

/* The source of motion, twists or an IMU: what init was given, and from `reading_ns` on what its readings have
 * shown. Of sigmas the squares. */
typedef struct plr_source {
    plr_real velocity_variance[3], gyro_variance[3]; /* of twists, in the body's axes */
    plr_real bias_velocity_walk, bias_gyro_walk;     /* of twists: variance that a second adds */
    plr_real R_BI[9], imu_arm[3];         /* the IMU on the body; `given` is seen from the arm */
    plr_real gravity;                     /* m/s^2 */
    plr_real accel_density, gyro_density; /* of an IMU: variance times the seconds of a reading */
    plr_real accel_walk_variance, gyro_walk_variance; /* of an IMU: what a second adds */
    plr_real start_velocity_variance;
    plr_real gate_d2;        /* of a velocity beside a reading */
    uint8_t process;         /* plr_process_kind: of the table of processes */
    uint8_t timing, noise;   /* plr_twist_timing; of twists plr_noise_kind */
    uint8_t poses_are_given; /* 1: in mapping, where no reading moves the pose */

    plr_time_ns reading_ns;         /* of the last twist or IMU reading */
    plr_real interval_s;            /* between the last two of them */
    plr_real reading[PLR_POSE_DIM]; /* the last one: (v, w) of a twist, (a, w) of an IMU */
    plr_real bias_prior[PLR_BIAS_DIM], bias_prior_sigma[PLR_BIAS_DIM];
    double bias_walked_s; /* for how long the biases have walked since that was their prior */
    plr_inertial inertial;
    uint8_t reading_valid;
    uint8_t velocities_known; /* 0: no small sensor has measured one, and `velocities` is zero */
    /* What one process alone needs, and only for a time. Of the "small" checksum: velocities with
     * twists, while any is known; alignment with an IMU, until it has started. */
    union {
        plr_velocities velocities;
        plr_alignment alignment;
    } either;
} plr_source;

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
} plr_belief;

/* The noise of a frame's motion. It is kept apart from P until the frame's observations have been
 * applied: the state's error is x + W nu with nu ~ N(0, I) beforehand, and the observations add
 * information (Lambda, eta) about nu. docs/MATH.md 10. */
typedef struct plr_noise {
    plr_real Wt[PLR_POSE_DIM * PLR_MAX_LD + PLR_KERNEL_MARGIN]; /* W^T, 6 x dim */
    plr_real Lambda[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN];     /* 6x6, packed upper triangle */
    plr_real eta[PLR_POSE_DIM];
    plr_real eta_of_S[PLR_CALIBRATIONS][PLR_POSE_DIM]; /* the same of the columns of S */
    plr_real z[PLR_POSE_DIM];               /* the value of nu at which the motion was linearised */
    plr_real motion_variance[PLR_POSE_DIM]; /* of the six numbers of the motion; 0: exact */
    plr_real
        range_shift[PLR_MAX_LANDMARKS]; /* linearisation point minus estimate, inverse range, 1/m */
    uint8_t open;                       /* 1: W belongs to the covariance and is not in P yet */
} plr_noise;

/* What a correction says of the calibration's errors s: J s = eta, J of the estimated by all. */
typedef struct plr_learnt {
    plr_real J[PLR_CALIBRATIONS * PLR_CALIBRATIONS], eta[PLR_CALIBRATIONS];
} plr_learnt;

/* An observation of the frame at hand, and what becomes of it: a row of the frame. */
typedef struct plr_sighting {
    const plr_observation *seen; /* the caller's, while the call lasts */
    uint16_t slot;               /* of its landmark, or PLR_NO_SLOT */
    uint8_t verdict;             /* plr_gate_result in gate.h */
    uint8_t used;                /* 1: the correction is to use it */
} plr_sighting;

/* What a frame shows of a landmark, linearised once and kept until the correction: three rows r = H x +
 * noise (src/sensor/measurement.h). */
typedef struct plr_linearised {
    plr_real H[PLR_ROWS * PLR_LANDMARK_DIM]; /* derivative by the landmark */
    plr_real r[PLR_ROWS], R[PLR_ROWS];       /* R: variances of the noise */
    plr_real d2; /* the squared distance from its prediction that the gate has judged, in sigmas */
    plr_real det_S; /* of the prediction's covariance: the larger, the more the observation tells */
} plr_linearised;

/* A frame: its valid observations, ascending by id, no id twice, and no two of one slot. */
typedef struct plr_sightings {
    plr_sighting at[PLR_MAX_OBSERVATIONS];
    /* Of those with a landmark, by its slot. Where the rows depend on the pose too, in `world`, that
     * derivative stands in plr_noise.Wt: such a model leaves it unused. */
    plr_linearised of_slot[PLR_MAX_LANDMARKS];
    uint16_t count;
    uint8_t terms; /* 2: the rows depend on the pose too */
} plr_sightings;

/* Workspace of one call; its contents are not used by later calls. */
typedef struct plr_workspace {
    /* Rows of V^T in an update, of [Y G]^T in a predict; a 3x3 matrix a landmark in a transport.
     * The kernels read a little further than they use, hence the margins. */
    plr_real Vt[PLR_WORK_ROWS * PLR_MAX_LD + PLR_KERNEL_MARGIN];
    plr_real dx[PLR_MAX_LD];
    plr_noise noise;             /* of the motion that this frame applies */
    plr_learnt learnt;           /* what this correction says of the calibration */
    plr_frame_evidence evidence; /* of this frame, for the supervisor */
    plr_sightings sightings;     /* the frame */
} plr_workspace;

/* Checksums of the filter's memory, to find out whether something else wrote to it. */
typedef struct plr_guard {
    uint64_t constant, small, large;
} plr_guard;

/* The checksums depend on the order of the members: config to par never change after init, work
 * changes without a checksum, guard is last. See src/filter/guard.h. */
typedef struct plr_filter {
    uint32_t magic; /* set by a successful init */
    plr_config config;
    plr_map map;
    plr_parameters par;

    plr_camera_model camera;
    plr_source source;
    plr_motion motion; /* since the last frame */
    plr_belief belief;
    plr_workspace work;

    plr_supervisor supervisor;
    uint16_t frames_off_the_map; /* in succession, that rejected nearly all known landmarks */
    uint8_t clock_started;
    plr_real recovery_P
        [PLR_POSE_TRIANGLE]; /* the pose's covariance when it was last in order, plus the motion
                                since; packed lower triangle */
    plr_totals totals;
    plr_guard guard;
} plr_filter;

#endif
