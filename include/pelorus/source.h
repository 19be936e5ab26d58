// SPDX-License-Identifier: MIT
/* A part of the filter's memory (state.h): the source of motion, twists with the velocities beside them, or an
 * IMU. For the library alone. */
#ifndef PELORUS_SOURCE_H
#define PELORUS_SOURCE_H

#include "pelorus/config.h"
#include "pelorus/types.h"

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

/* How far the start of an IMU has come (docs/MATH.md 19); src/process/imu_phase.h says what leads on. A world is
 * given by a pose with its covariance, a measured position or a map; else position and yaw are free. */
typedef enum plr_imu_phase {
    PLR_IMU_ALIGNS,             /* tilt and velocity are not known: nothing moves the state */
    PLR_IMU_ALIGNS_IN_WORLD,    /* likewise, in a world that is given */
    PLR_IMU_UNSETTLED,          /* started in motion: the anchor will lay the world anew */
    PLR_IMU_UNSETTLED_IN_WORLD, /* likewise: it will widen the variances by what the first second
                                   may have misled position and yaw */
    PLR_IMU_SETTLED,            /* position and yaw are fixed: by the start, or by the anchor */
    PLR_IMU_PHASES
} plr_imu_phase;

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
    uint8_t phase;          /* plr_imu_phase */
    uint8_t pose_given;     /* 1: plr_filter_set_pose was called */
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

enum { PLR_WHEELS = 4 };

/* Wheels, each known by its place: src/process/wheels.h. */
typedef struct plr_wheels {
    plr_time_ns t_ns[PLR_WHEELS];     /* of the last reading of each */
    plr_time_ns moved_ns[PLR_WHEELS]; /* of the last one that moved, or that followed a silence */
    plr_time_ns slip_ns[PLR_WHEELS];  /* since when it slips; 0: it does not */
    plr_time_ns interval_ns[PLR_WHEELS]; /* between its last two readings */
    plr_time_ns rest_ns;                 /* when a standstill was last told by them */
    plr_real at_B[3 * PLR_WHEELS];       /* m; with an IMU seen from it */
    plr_real slip[3 * PLR_WHEELS]; /* by how much a slipping one differs from the estimate, m/s */
    uint8_t count, latest; /* latest: the one that sent the last reading; count: none of them */
} plr_wheels;

/* The source of motion, twists or an IMU: what init was given, up to `poses_are_given`; what is used for a time
 * alone; and from `reading_ns` on what every reading changes. Of sigmas the squares. */
typedef struct plr_source {
    plr_real velocity_variance[3], gyro_variance[3]; /* of twists, in the body's axes */
    plr_real bias_velocity_walk, bias_gyro_walk;     /* of twists: variance that a second adds */
    plr_real R_BI[9], imu_arm[3];         /* the IMU on the body; camera.given is as seen from it */
    plr_real gravity;                     /* m/s^2 */
    plr_real accel_density, gyro_density; /* of an IMU: variance times the seconds of a reading */
    plr_real accel_walk_variance, gyro_walk_variance; /* of an IMU: what a second adds */
    plr_real start_velocity_variance;
    plr_real gate_d2;        /* of a velocity beside a reading */
    uint8_t process;         /* plr_process_kind: of the table of processes */
    uint8_t timing, noise;   /* plr_twist_timing; of twists plr_noise_kind */
    uint8_t poses_are_given; /* 1: in mapping, where no reading moves the pose */

    /* The checksum has each of these only while it is used. */
    plr_alignment alignment;   /* with an IMU, until it has started */
    plr_velocities velocities; /* with twists, while any is known */
    plr_wheels wheels;         /* once one has sent a reading */

    plr_time_ns reading_ns;         /* of the last twist or IMU reading */
    plr_real interval_s;            /* between the last two of them */
    plr_real reading[PLR_POSE_DIM]; /* the last one: (v, w) of a twist, (a, w) of an IMU */
    plr_real bias_prior[PLR_BIAS_DIM], bias_prior_sigma[PLR_BIAS_DIM];
    double bias_walked_s; /* for how long the biases have walked since that was their prior */
    uint32_t unused;      /* readings refused since the filter's time last moved */
    plr_inertial inertial;
    uint64_t left_out; /* as plr_supervisor.left_out: rules that are left out, for measurements */
    uint8_t reading_valid;
    uint8_t velocities_known; /* 0: no small sensor has measured one, and `velocities` is zero */
} plr_source;

#endif
