// SPDX-License-Identifier: MIT
/*
 * The settings of a filter, with unit, limits, default and advice for each, and the table that
 * names them. The replay's options, its config files and the CONFIG frame all use the table, so a
 * setting has the same name, number, limits and default everywhere.
 */
#ifndef PELORUS_SETTINGS_H
#define PELORUS_SETTINGS_H

#include "pelorus/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/* How landmarks are stored, and how the error of the state is defined: docs/MATH.md 2. */
typedef enum plr_model_kind {
    PLR_MODEL_BODY = 0, /* relative to the camera, as bearing and inverse range, in an invariant
                           filter: consistent; choose this one */
    PLR_MODEL_WORLD = 1 /* as points of the world, like a textbook's EKF: overconfident; for
                           comparison, and in float64 builds only */
} plr_model_kind;

typedef enum plr_mode {
    PLR_MODE_SLAM = 0,          /* pose and landmarks are estimated together */
    PLR_MODE_MAPPING = 1,       /* every frame's pose is given as exact; landmarks are estimated */
    PLR_MODE_LOCALIZATION = 2,  /* all landmarks come from the map source; the pose is estimated */
    PLR_MODE_DEAD_RECKONING = 3 /* the pose follows twists or IMU; observations are not used */
} plr_mode;

/* The interval for which the twist reading taken at t_j is valid. */
typedef enum plr_twist_timing {
    PLR_TWIST_START = 0, /* from t_j to the next reading */
    PLR_TWIST_END = 1,   /* from the previous reading to t_j */
    PLR_TWIST_MID = 2    /* between two readings their mean is valid */
} plr_twist_timing;

/* What moves the state between frames. */
typedef enum plr_process_kind {
    PLR_PROCESS_TWIST = 0, /* measured velocities: plr_filter_predict */
    PLR_PROCESS_IMU = 1    /* accelerometer and gyro: plr_filter_inertial */
} plr_process_kind;

/* How the filter finds its tilt, velocity and biases with an IMU. */
typedef enum plr_imu_start {
    PLR_IMU_START_AUTO = 0,   /* given, if a velocity is set; else at rest, or in motion if the body
                                 does not come to rest within 3 s, or within 1 s if most
                                 points that are watched move in the picture */
    PLR_IMU_START_REST = 1,   /* the body stands for a second: tilt and gyro bias are measured */
    PLR_IMU_START_MOTION = 2, /* the body moves: tilt from a tenth of a second, velocity unknown */
    PLR_IMU_START_GIVEN = 3   /* the pose that is set is true, and the velocity with it */
} plr_imu_start;

/* What velocity_sigma and gyro_sigma are standard deviations of. */
typedef enum plr_noise_kind {
    PLR_NOISE_TWIST = 0, /* one twist reading, m/s and rad/s */
    PLR_NOISE_STEP = 1   /* the displacement between two readings, m and rad, however long the step
                            takes: the matrix W in equation III.8 of the course report */
} plr_noise_kind;

/* Whether most of what is seen may move as one, and what follows where pictures contradict odometry. */
typedef enum plr_scene_policy {
    PLR_SCENE_STANDS = 0,  /* no: pictures that agree are right, and the covariance is theirs */
    PLR_SCENE_MAY_MOVE = 1 /* yes: the covariance covers the poses by both */
} plr_scene_policy;

/* The error of a new landmark in the model `world`. */
typedef enum plr_landmark_prior {
    PLR_PRIOR_CORRELATED = 0, /* contains the error of the pose it was seen from: correct */
    PLR_PRIOR_INDEPENDENT = 1 /* landmark_sigma_m alone, unrelated to the pose: what the course
                                 report does (its Sigma_m) */
} plr_landmark_prior;

/* Parts of the calibration of camera and wheels, as bits. */
typedef enum plr_calibrate {
    PLR_CALIBRATE_FOCAL = 1,        /* focal-sigma */
    PLR_CALIBRATE_BASELINE = 2,     /* baseline-sigma */
    PLR_CALIBRATE_TURN = 4,         /* camera-turn-sigma, about three axes */
    PLR_CALIBRATE_CENTRE = 8,       /* centre-sigma, u and v */
    PLR_CALIBRATE_PLACE = 16,       /* camera-place-sigma, along three axes */
    PLR_CALIBRATE_CLOCK = 32,       /* camera-clock-sigma */
    PLR_CALIBRATE_WHEEL_SCALE = 64, /* wheel-scale-sigma */
    PLR_CALIBRATE_WHEEL_TRACK = 128 /* wheel-track-sigma */
} plr_calibrate;

/* The settings of a filter. Fill it by plr_config_default and change what your robot needs: usually
 * the three noise sigmas and twist_timing.
 *
 * Above each field stands its row of the table src/record/settings.def: name, unit, limits (both
 * included) and default. tests/layering/schema.py writes these lines from the table.
 *
 * Within the limits some combinations are refused too: min_depth_m not below max_range_m;
 * min_depth_m not below a max_depth_m above 0; landmark_sigma_m or the independent landmark_prior
 * in the model `body`; the independent landmark_prior without landmark_sigma_m; track_drift_px
 * in the model `world`; the process IMU in the model `world`, or without `bias`; a part of
 * the calibration in `calibrate` whose sigma is 0, or more parts than the build has room for; known landmarks
 * or scene may-move where the build has no PLR_KNOWN_MAP or PLR_SUPERVISE. */
typedef struct plr_config {
    /* Setting model: one of plr_model_kind, default PLR_MODEL_BODY. */
    uint8_t model;

    /* Setting mode: one of plr_mode, default PLR_MODE_SLAM. */
    uint8_t mode;

    /* Setting twist-timing: one of plr_twist_timing, default PLR_TWIST_START.
     * END for odometry that reports what it has just counted; START where the reading is a sample
     * of the velocity or a command; MID for samples of a velocity that changes smoothly. A wrong
     * choice shifts the motion in time by up to one interval. */
    uint8_t twist_timing;

    /* Setting noise: one of plr_noise_kind, default PLR_NOISE_TWIST.
     * TWIST for sensors; STEP only to repeat the figures of the course report. */
    uint8_t noise;

    /* Setting bias: 0 or 1, default 1.
     * 1: constant errors of the twists (6 numbers) are estimated as well. 0 saves time and memory;
     * choose it only where the twists have no such errors. An IMU needs 1. */
    uint8_t bias;

    /* Setting calibrate: 0 to 255, default 0.
     * Which parts of the calibration are estimated on the way: bits of plr_calibrate. Each
     * begins as the calibration says, with the sigma of its own setting, and is learnt as far as the
     * drive shows it: with an IMU a minute of walking with turns shows all of them, at rest and at
     * constant speed none is observable. With twists less is: their scale and axes may be wrong too, and
     * what successive frames have in common counts as error of the twists. Parts that are not
     * listed are considered: covariances contain their sigma, and estimates do not depend on it. */
    uint8_t calibrate;

    /* Setting known-map: 0 or 1, default 0.
     * 1: in the mode slam, an unknown id is first looked up in the map source, and a pose that is lost is
     * found again from known landmarks. (In localization both are always so.) */
    uint8_t known_map;

    /* Setting scene: one of plr_scene_policy, default PLR_SCENE_STANDS.
     * Wheels that slip and a scene that moves as one look the same in the data: pictures that agree with
     * each other, and odometry that does not. STANDS where most of what is seen is fixed: the reported
     * covariance stays small after a slip. MAY_MOVE in a warehouse with forklifts, in a convoy, on a ship:
     * after each contradiction the covariance covers both stories, for good, unless a position or a map
     * tells which is true. */
    uint8_t scene;

    /* Setting landmark-prior: one of plr_landmark_prior, default PLR_PRIOR_CORRELATED. */
    uint8_t landmark_prior;

    /* Setting slots: 1 to PLR_MAX_LANDMARKS, default 100 or PLR_MAX_LANDMARKS, the smaller.
     * Landmarks in the state at once. More are more accurate; the time that an observation costs
     * grows with the square of their number. Choose about as many as the tracker follows at once
     * (docs/NUMERICS.md 11); where it follows more, all parts of the image have their share. */
    uint16_t slots;

    /* Setting process: one of plr_process_kind, default PLR_PROCESS_TWIST.
     * What moves the state. With IMU, velocity is estimated, and the biases are those of
     * accelerometer and gyro; imu-turn and imu-arm say where the IMU is on the body. */
    uint8_t process;

    /* Setting imu-start: one of plr_imu_start, default PLR_IMU_START_AUTO.
     * A start in motion leaves position and yaw wrong by some 0.3 m and 2 degrees, and health is
     * DEGRADED for two seconds (PLR_REASON_POSE_MAY_BE_WRONG). Then the world is defined anew by the
     * estimated position and yaw, which count as known to start-sigma from there on. If the world is
     * given, by a pose set with a covariance, a measured position or a known landmark, the covariance
     * is enlarged by that error instead. */
    uint8_t imu_start;

    /* Setting imu-timing: one of plr_twist_timing, default PLR_TWIST_MID.
     * START or END only for an IMU that sends means over an interval instead of samples. */
    uint8_t imu_timing;

    /* Setting pixel-sigma [px]: 1e-3 to 1e3, default 2.
     * Standard deviation of one pixel coordinate. Measure it: the scatter of tracked points about
     * where they should be, usually 0.5 to 5. If health says NIS_HIGH it is too small, NIS_LOW too
     * large. In mapping, use the scatter about the given poses (docs/NUMERICS.md 12). */
    double pixel_sigma_px;

    /* Setting velocity-sigma [m/s]: 0 to 1e3, default 0.1.
     * Standard deviation of a velocity reading along the body's x, y and z axes; m with noise STEP.
     * Include slip: a wheeled robot needs more across than along. */
    double velocity_sigma[3];

    /* Setting gyro-sigma [rad/s]: 0 to 1e2, default 0.01.
     * Standard deviation of a rate reading about the body's x, y and z axes; rad with noise STEP.
     * Take the gyro's noise at the rate of its readings, plus vibration. */
    double gyro_sigma[3];

    /* Setting bias-velocity-sigma [m/s]: 0 to 1e2, default 0.005.
     * Standard deviation of the velocity bias at the start, before anything is known of it. Wheels
     * have no offset; the default is half a percent at walking pace. Too small shows as the reason
     * BIAS_OFF_PRIOR; too large, and points that drift in the picture become a bias. */
    double bias_velocity_sigma_mps;

    /* Setting bias-gyro-sigma [rad/s]: 0 to 10, default 0.01.
     * The same of the gyro bias: its data sheet's bias after calibration. For an IMU whose HEADER says
     * none plr_session takes 0.1: data sheets have up to 20 degrees a second. A start at rest measures it,
     * and needs no more of this than that it is not far too small. */
    double bias_gyro_sigma_radps;

    /* Setting bias-velocity-walk [(m/s)^2/s]: 0 to 1e2, default 1e-8.
     * Variance that the velocity bias gains in a second. 0: the bias is constant. A bias that
     * changes by d in t seconds needs about d^2 / t. */
    double bias_velocity_walk;

    /* Setting bias-gyro-walk [(rad/s)^2/s]: 0 to 1e2, default 1e-10.
     * The same of the gyro bias. */
    double bias_gyro_walk;

    /* Setting gate-d2: 0 to 1e12, default 13.276704135987622.
     * Observations with a larger squared Mahalanobis distance (4 degrees of freedom) are rejected.
     * The default is the 99 % point of chi-square; 9.488 is 95 %, 18.467 is 99.9 %. 0: no gate. */
    double gate_d2;

    /* Setting gate-residual [px]: 0 to 1e4, default 0.
     * Above 0: the course report's gate in place of gate-d2. Rejects an observation whose four
     * residuals (uL, vL, uR, vR) have a larger norm. It does not know how uncertain the prediction
     * is: use it only for comparison. */
    double gate_residual_px;

    /* Setting min-disparity [px]: 0 to 1e4, default 0.
     * A new landmark needs at least this disparity. 0 in the model `body` without max-depth: any
     * disparity that pixel noise may give a point at infinity, slightly negative ones included.
     * Leave it at 0: a limit above 0 selects far points by their noise, which biases speed. */
    double min_disparity_px;

    /* Setting max-depth [m]: 0 to 1e6, default 0.
     * Greatest depth of a new landmark; 0: no limit. Leave it at 0 in the model `body`; `world`
     * needs a limit; the preset plr_config_course has 30 m. */
    double max_depth_m;

    /* Setting max-row-gap [px]: 0 to 1e4, default 2.
     * Greatest |vL - vR| of a new landmark; 0: no limit. In a rectified pair the two rows agree but
     * for noise, of 1.4 times pixel-sigma: a larger gap is a wrong match, but a limit below 4 times
     * pixel-sigma also turns good matches away. */
    double max_row_gap_px;

    /* Setting min-depth [m]: 0.01 to 1e3, default 0.3.
     * Observations of a point that is predicted nearer than this are rejected, and no landmark is
     * created there. Choose the shortest distance at which both cameras see and focus a point. */
    double min_depth_m;

    /* Setting start-sigma [m and rad]: 1e-9 to 1e3, default 1e-4.
     * Standard deviation of each component of the start pose, where no covariance is given with it.
     * Keep it small where the start is the origin of the world by definition. */
    double start_sigma;

    /* Setting landmark-sigma [m]: 0 to 1e3, default 0.
     * Standard deviation of a new landmark on each axis, in the model `world` only. 0: computed
     * from pixel-sigma, which is correct; above 0 for comparison with the course report. */
    double landmark_sigma_m;

    /* Setting max-range [m]: 1 to 1e6, default 1e5.
     * No landmark is placed beyond this distance: further points are all alike to the camera. */
    double max_range_m;

    /* Setting max-gap [s]: 1e-3 to 60, default 2.
     * A reading or frame further ahead than this is refused with PLR_E_GAP. Choose the longest
     * pause over which the last twist or IMU reading may still be taken as valid. */
    double max_gap_s;

    /* Setting twist-delay [s]: 0 to 10, default 0.
     * Used by plr_session alone: twists, IMU readings and frames wait this long for each other, so
     * that all are processed in the order of time. Choose the longer of two delays: the camera's,
     * from shutter to message, and that of the readings, from the first of a batch to its message.
     * At most PLR_SESSION_HELD_TWISTS and PLR_SESSION_HELD_FRAMES wait; a frame that is not ahead
     * of the readings does not. */
    double twist_delay_s;

    /* Setting standstill-sigma [m/s]: 0 to 1, default 0.
     * How still a standing robot is, in m/s, and in rad/s for its turning; 0: standstill is not
     * detected. Above 0, if for a second no pixel moves by more than its noise, and twists or IMU do
     * not contradict, the filter measures a velocity of zero with this sigma. Pixels cannot show a
     * motion slower than that: choose about pixel-sigma
     * times the usual depth over the focal length, per second (2 px, 5 m, 500 px: 0.02 m/s). */
    double standstill_sigma_mps;

    /* Setting imu-turn [rad]: -3.2 to 3.2, default 0.
     * Three numbers: the rotation vector that turns the IMU's axes into the body's. 3.1416,0,0 for
     * an IMU that is mounted upside down. Calibration, poses and velocities are the body's. */
    double imu_turn_rad[3];

    /* Setting imu-arm [m]: -100 to 100, default 0.
     * Three numbers: where the IMU is on the body, in the body's axes. */
    double imu_arm_m[3];

    /* Setting focal-sigma: 0 to 0.1, default 0.005.
     * The relative error of the focal length, one sigma. Such an error does not average out: each
     * turn is wrong by the same share, and at constant speed and turn nothing shows it. The reported
     * covariances of pose, velocity, biases and landmarks contain it; estimates do not depend on it,
     * unless `calibrate` has it learnt. 0: the camera is exact, as a simulated one is. */
    double focal_sigma;

    /* Setting baseline-sigma: 0 to 0.1, default 0.005.
     * The same of the baseline: each distance is wrong by the same share. */
    double baseline_sigma;

    /* Setting camera-turn-sigma [rad]: 0 to 0.2, default 0.003.
     * The error of the camera's attitude on the body (in T_CB), one sigma about each of its axes. A
     * camera that looks 0.3 degrees aside sees a straight way half a percent askew, and at constant
     * speed that looks like a bias. The default is what a careful calibration leaves, and covers half
     * a degree; 0.01 for a mount that was measured by hand. Otherwise as focal-sigma. */
    double camera_turn_sigma_rad;

    /* Setting centre-sigma [px]: 0 to 100, default 0.
     * The error of the principal point, cx and cy, one sigma of each. Otherwise as focal-sigma. */
    double centre_sigma_px;

    /* Setting camera-place-sigma [m]: 0 to 1, default 0.
     * The error of the camera's position (in T_CB), one sigma along each of its axes. */
    double camera_place_sigma_m;

    /* Setting camera-clock-sigma [s]: 0 to 0.1, default 0.
     * The error of the time of every frame, one sigma: of what camera-offset does not make up for. */
    double camera_clock_sigma_s;

    /* Setting track-drift [px/sqrt(s)]: 0 to 100, default 0.
     * How far tracks wander off their points: sigma after a second, growing as the root of time. A
     * tracker that follows a patch from frame to frame (KLT) drifts, by about 1 on KITTI's streets.
     * Without it the filter averages over a long track as if each frame showed the same point, and
     * is more certain than it may be. `pelorus check` measures it where it is more than
     * about the pixels' noise in a second. Landmarks of the map do not drift. With `body` alone. */
    double track_drift_px;

    /* Setting gyro-noise [rad/s/sqrt(Hz)]: 0 to 10, default 1e-3.
     * Noise density of the gyro, as Kalibr and data sheets give it (1 deg/s/sqrt(Hz) = 0.01745).
     * It is the least: where the readings scatter by more, their scatter counts, because vibration comes on
     * top of the data sheet's figure (docs/NUMERICS.md 13). A recording's HEADER may raise this default and the
     * three below, and does not lower them. */
    double gyro_noise;

    /* Setting accel-noise [m/s^2/sqrt(Hz)]: 0 to 100, default 1e-2.
     * The same of the accelerometer (1 mg/sqrt(Hz) = 0.0098). */
    double accel_noise;

    /* Setting gyro-walk [rad/s^2/sqrt(Hz)]: 0 to 1, default 1e-4.
     * Random walk of the gyro's bias: it gains the variance gyro-walk^2 in a second. */
    double gyro_walk;

    /* Setting accel-walk [m/s^3/sqrt(Hz)]: 0 to 10, default 1e-3.
     * The same of the accelerometer's bias. */
    double accel_walk;

    /* Setting bias-accel-sigma [m/s^2]: 1e-6 to 10, default 0.3.
     * Standard deviation of the accelerometer's bias at the start: data sheets have offsets of 20 to 80
     * mg. bias-gyro-sigma is that of the gyro. */
    double bias_accel_sigma_mps2;

    /* Setting gravity [m/s^2]: 0.1 to 30, default 9.81.
     * Gravity at the place: 9.780 at the equator, 9.832 at the poles. */
    double gravity_mps2;

    /* Setting start-velocity-sigma [m/s]: 1e-6 to 100, default 3.
     * Standard deviation of each component of the velocity at a start in motion, or where a pose is
     * given without velocity. Choose the robot's usual speed. */
    double start_velocity_sigma_mps;

    /* Setting gyro-range [rad/s]: 0 to 1e3, default 0.
     * A reading at or beyond it is refused as saturated. 0: not known. */
    double gyro_range_radps;

    /* Setting accel-range [m/s^2]: 0 to 1e4, default 0.
     * The same of the accelerometer (16 g = 157). */
    double accel_range_mps2;

    /* Setting camera-offset [s]: -1 to 1, default 0.
     * Used by plr_session alone: added to the time of every frame, so that it is the clock of IMU
     * or twists (Kalibr's timeshift_cam_imu). If it is negative, twists and readings wait that much
     * longer than twist-delay. If it is positive and a frame comes before the steps up to its time,
     * as in a recording in order of stamps, it waits that much longer for them. */
    double camera_offset_s;

    /* Setting wheel-scale-sigma: 0 to 0.2, default 0.
     * Beside an IMU: standard deviation of the share by which the radius of the wheels may be wrong, the same of
     * all. It is considered, or with calibrate = wheel-scale estimated. */
    double wheel_scale_sigma;

    /* Setting wheel-track-sigma: 0 to 0.2, default 0.
     * The same of the distance between wheels: their places (at_B_m) move away from the middle of all
     * that have sent a reading, at most four. calibrate = wheel-track estimates it. */
    double wheel_track_sigma;

    /* Setting wheel-slide-sigma [m/s]: 0 to 10, default 0.
     * A body that can neither slide nor rise: along the axes that a wheel's reading does not measure its point
     * has the velocity 0 with this standard deviation. 0: a reading says nothing of the other axes, as for wheels that
     * roll sideways. It is that of one reading, and independent from one to the next. */
    double wheel_slide_sigma_mps;
} plr_config;

/* How a setting's value is written. */
typedef enum plr_setting_kind {
    PLR_SETTING_NUMBER,
    PLR_SETTING_COUNT,  /* a whole number */
    PLR_SETTING_SWITCH, /* off, on */
    PLR_SETTING_CHOICE, /* one of .choices */
    PLR_SETTING_LIST    /* some of .choices, as bits: off, or words between commas */
} plr_setting_kind;

/* One row of the table. */
typedef struct plr_setting {
    uint8_t id;       /* number in a CONFIG frame; never reused */
    const char *name; /* as in options and config files: "pixel-sigma" */
    const char *unit; /* "px"; "" where there is none */
    plr_setting_kind kind;
    const char *const *choices; /* words, ended by NULL, for SWITCH, CHOICE and LIST; else NULL */
    double minimum, maximum, standard; /* limits, both included, and the default */
} plr_setting;

/* Number of settings. */
unsigned plr_setting_count(void);

/* Row index of the table, 0 to plr_setting_count() - 1; NULL beyond. */
const plr_setting *plr_setting_at(unsigned index);

/* One line for a help text. */
const char *plr_setting_about(const plr_setting *setting);

/* The row of that id or name; NULL if there is none. */
const plr_setting *plr_setting_by_id(uint8_t id);
const plr_setting *plr_setting_by_name(const char *name);

/* The row of one axis (0 to 2: x, y, z of the body) of a setting that has three numbers:
 * velocity-sigma, gyro-sigma, imu-turn and imu-arm. NULL for a setting of one number. The setting's
 * own row sets all three axes and reads x; further rows set y and z alone, so apply them after
 * it. */
const plr_setting *plr_setting_axis(const plr_setting *setting, unsigned axis);

/* For the row of a y or z axis: the setting whose own row sets all three axes. NULL for all other
 * rows. */
const plr_setting *plr_setting_of_axis(const plr_setting *setting);

/* The value of a setting as a number (switches 0 or 1, choices their number). */
double plr_config_get(const plr_config *config, const plr_setting *setting);

/* Sets a value. PLR_E_CONFIG, and nothing changed, if it is outside the limits or not finite. */
plr_status plr_config_set(plr_config *config, const plr_setting *setting, double value);

/* Every setting at its default. */
void plr_config_default(plr_config *config);

/* The hyperparameters in section III-F of the course report (docs/COURSE.md): world model, no bias,
 * start timing, landmark variance 2 m^2, uncorrelated with the pose, pose variance 5e-4, pixel
 * variance 5 px^2, motion variance 1e-3 a step, and a gate on the norm of the four residuals. The
 * report leaves out far landmarks and large residuals without naming a limit; 30 m and 20 px are
 * this project's choice. */
void plr_config_course(plr_config *config);

/* PLR_OK, or PLR_E_CONFIG with the offending row in *culprit (which may be NULL). Refuses values
 * outside their limits, and the combinations listed above plr_config; *culprit is then the row to
 * change. PLR_E_ARGUMENT: no config. */
plr_status plr_config_check(const plr_config *config, const plr_setting **culprit);

/* Why plr_config_check refuses it, for a person: "imu needs model = body and bias = on"; NULL: it does not.
 * *culprit (which may be NULL) as there. There must be a config. */
const char *plr_config_why(const plr_config *config, const plr_setting **culprit);

#ifdef __cplusplus
}
#endif

#endif
