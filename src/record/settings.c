// SPDX-License-Identifier: MIT
#include "pelorus/settings.h"

#include <stddef.h>
#include <string.h>

#include "pelorus/config.h"

static const char *const model_words[] = {"body", "world", NULL};
static const char *const mode_words[] = {"slam", "mapping", "localization", "dead_reckoning", NULL};
static const char *const timing_words[] = {"start", "end", "mid", NULL};
static const char *const noise_words[] = {"twist", "step", NULL};
static const char *const prior_words[] = {"correlated", "independent", NULL};
static const char *const process_words[] = {"twist", "imu", NULL};
static const char *const imu_start_words[] = {"auto", "rest", "motion", "given", NULL};
static const char *const scene_words[] = {"stands", "may-move", NULL};
static const char *const calibrate_words[] = {"focal", "baseline", "turn", "centre",
                                              "place", "clock",    NULL};
static const char *const switch_words[] = {"off", "on", NULL};

/* How a field of plr_config is stored. */
typedef enum plr_storage {
    STORE_U8,
    STORE_U16,
    STORE_DOUBLE,
    STORE_AXES /* three doubles: set to the same value, known by the first */
} plr_storage;

typedef struct plr_row {
    plr_setting setting;
    size_t offset;
    plr_storage storage;
} plr_row;

#define AT(field) offsetof(plr_config, field)
/* clang-format off */
static const plr_row rows[] = {
    {{1, "model", "", "where landmarks live", PLR_SETTING_CHOICE, model_words, 0, 1, PLR_MODEL_BODY}, AT(model), STORE_U8},
    {{2, "mode", "", "what is estimated", PLR_SETTING_CHOICE, mode_words, 0, 3, PLR_MODE_SLAM}, AT(mode), STORE_U8},
    {{3, "bias", "", "estimate the biases of the twist", PLR_SETTING_SWITCH, switch_words, 0, 1, 1}, AT(bias), STORE_U8},
    {{4, "slots", "", "landmarks held at once", PLR_SETTING_COUNT, NULL, 1, PLR_MAX_LANDMARKS, PLR_MAX_LANDMARKS < 100 ? PLR_MAX_LANDMARKS : 100}, AT(slots), STORE_U16},
    {{5, "known-map", "", "slam uses known landmarks too", PLR_SETTING_SWITCH, switch_words, 0, 1, 0}, AT(known_map), STORE_U8},
    {{6, "twist-timing", "", "which interval a reading stands for", PLR_SETTING_CHOICE, timing_words, 0, 2, PLR_TWIST_START}, AT(twist_timing), STORE_U8},
    {{7, "noise", "", "the sigmas are a reading's, or a step's", PLR_SETTING_CHOICE, noise_words, 0, 1, PLR_NOISE_TWIST}, AT(noise), STORE_U8},
    {{8, "pixel-sigma", "px", "noise of a pixel coordinate", PLR_SETTING_NUMBER, NULL, 1e-3, 1e3, 2}, AT(pixel_sigma_px), STORE_DOUBLE},
    {{9, "velocity-sigma", "m/s", "noise of a velocity reading: of each axis, or of x, y, z", PLR_SETTING_NUMBER, NULL, 0, 1e3, 0.1}, AT(velocity_sigma), STORE_AXES},
    {{10, "gyro-sigma", "rad/s", "noise of a rate reading: of each axis, or of x, y, z", PLR_SETTING_NUMBER, NULL, 0, 1e2, 0.01}, AT(gyro_sigma), STORE_AXES},
    {{11, "bias-velocity-sigma", "m/s", "prior of the velocity bias", PLR_SETTING_NUMBER, NULL, 0, 1e2, 0.005}, AT(bias_velocity_sigma_mps), STORE_DOUBLE},
    {{12, "bias-gyro-sigma", "rad/s", "prior of the gyro bias", PLR_SETTING_NUMBER, NULL, 0, 10, 0.01}, AT(bias_gyro_sigma_radps), STORE_DOUBLE},
    {{13, "bias-velocity-walk", "(m/s)^2/s", "variance that the velocity bias gains in a second", PLR_SETTING_NUMBER, NULL, 0, 1e2, 1e-8}, AT(bias_velocity_walk), STORE_DOUBLE},
    {{14, "bias-gyro-walk", "(rad/s)^2/s", "variance that the gyro bias gains in a second", PLR_SETTING_NUMBER, NULL, 0, 1e2, 1e-10}, AT(bias_gyro_walk), STORE_DOUBLE},
    {{15, "gate-d2", "", "largest squared Mahalanobis distance, 4 d.o.f.; 0 = off", PLR_SETTING_NUMBER, NULL, 0, 1e12, 13.276704135987622}, AT(gate_d2), STORE_DOUBLE},
    {{16, "gate-residual", "px", "instead: largest norm of the four residuals; 0 = off", PLR_SETTING_NUMBER, NULL, 0, 1e4, 0}, AT(gate_residual_px), STORE_DOUBLE},
    {{17, "min-disparity", "px", "least disparity of a new landmark; 0 = as noise leaves it to far ones", PLR_SETTING_NUMBER, NULL, 0, 1e4, 0}, AT(min_disparity_px), STORE_DOUBLE},
    {{18, "max-depth", "m", "greatest depth of a new landmark; 0 = no limit", PLR_SETTING_NUMBER, NULL, 0, 1e6, 0}, AT(max_depth_m), STORE_DOUBLE},
    {{19, "max-row-gap", "px", "greatest |vL - vR| of a new landmark; 0 = no limit", PLR_SETTING_NUMBER, NULL, 0, 1e4, 2}, AT(max_row_gap_px), STORE_DOUBLE},
    {{20, "min-depth", "m", "predicted depth below which nothing is linearised", PLR_SETTING_NUMBER, NULL, 0.01, 1e3, 0.3}, AT(min_depth_m), STORE_DOUBLE},
    {{21, "start-sigma", "m and rad", "initial pose, where no covariance is given", PLR_SETTING_NUMBER, NULL, 1e-9, 1e3, 1e-4}, AT(start_sigma), STORE_DOUBLE},
    {{22, "landmark-sigma", "m", "initial landmark, world model; 0 = from the pixels", PLR_SETTING_NUMBER, NULL, 0, 1e3, 0}, AT(landmark_sigma_m), STORE_DOUBLE},
    {{23, "max-range", "m", "greatest distance of any landmark", PLR_SETTING_NUMBER, NULL, 1, 1e6, 1e5}, AT(max_range_m), STORE_DOUBLE},
    {{24, "max-gap", "s", "longest pause in the data that is bridged", PLR_SETTING_NUMBER, NULL, 1e-3, 60, 2}, AT(max_gap_s), STORE_DOUBLE},
    {{25, "twist-delay", "s", "frames, twists and IMU readings wait so long for each other", PLR_SETTING_NUMBER, NULL, 0, 10, 0}, AT(twist_delay_s), STORE_DOUBLE},
    {{26, "landmark-prior", "", "does a new landmark of world share the pose's error?", PLR_SETTING_CHOICE, prior_words, 0, 1, PLR_PRIOR_CORRELATED}, AT(landmark_prior), STORE_U8},
    {{27, "velocity-sigma-y", "m/s", "of the y axis alone", PLR_SETTING_NUMBER, NULL, 0, 1e3, 0.1}, AT(velocity_sigma[1]), STORE_DOUBLE},
    {{28, "velocity-sigma-z", "m/s", "of the z axis alone", PLR_SETTING_NUMBER, NULL, 0, 1e3, 0.1}, AT(velocity_sigma[2]), STORE_DOUBLE},
    {{29, "gyro-sigma-y", "rad/s", "of the y axis alone", PLR_SETTING_NUMBER, NULL, 0, 1e2, 0.01}, AT(gyro_sigma[1]), STORE_DOUBLE},
    {{30, "gyro-sigma-z", "rad/s", "of the z axis alone", PLR_SETTING_NUMBER, NULL, 0, 1e2, 0.01}, AT(gyro_sigma[2]), STORE_DOUBLE},
    {{31, "standstill-sigma", "m/s", "detected standing is measured with it, m/s and rad/s; 0 = off", PLR_SETTING_NUMBER, NULL, 0, 1, 0}, AT(standstill_sigma_mps), STORE_DOUBLE},
    {{32, "process", "", "what moves the state between frames", PLR_SETTING_CHOICE, process_words, 0, 1, PLR_PROCESS_TWIST}, AT(process), STORE_U8},
    {{33, "gyro-noise", "rad/s/sqrt(Hz)", "noise density of the gyro", PLR_SETTING_NUMBER, NULL, 0, 10, 1e-3}, AT(gyro_noise), STORE_DOUBLE},
    {{34, "accel-noise", "m/s^2/sqrt(Hz)", "noise density of the accelerometer", PLR_SETTING_NUMBER, NULL, 0, 100, 1e-2}, AT(accel_noise), STORE_DOUBLE},
    {{35, "gyro-walk", "rad/s^2/sqrt(Hz)", "random walk of the IMU's gyro bias", PLR_SETTING_NUMBER, NULL, 0, 1, 1e-4}, AT(gyro_walk), STORE_DOUBLE},
    {{36, "accel-walk", "m/s^3/sqrt(Hz)", "random walk of the accelerometer's bias", PLR_SETTING_NUMBER, NULL, 0, 10, 1e-3}, AT(accel_walk), STORE_DOUBLE},
    {{37, "bias-accel-sigma", "m/s^2", "prior of the accelerometer's bias", PLR_SETTING_NUMBER, NULL, 1e-6, 10, 0.3}, AT(bias_accel_sigma_mps2), STORE_DOUBLE},
    {{38, "gravity", "m/s^2", "gravity at the place", PLR_SETTING_NUMBER, NULL, 0.1, 30, 9.81}, AT(gravity_mps2), STORE_DOUBLE},
    {{39, "imu-start", "", "how tilt and velocity are found with an IMU", PLR_SETTING_CHOICE, imu_start_words, 0, 3, PLR_IMU_START_AUTO}, AT(imu_start), STORE_U8},
    {{40, "start-velocity-sigma", "m/s", "velocity at a start in motion", PLR_SETTING_NUMBER, NULL, 1e-6, 100, 3}, AT(start_velocity_sigma_mps), STORE_DOUBLE},
    {{41, "gyro-range", "rad/s", "readings from there on are saturated; 0 = not known", PLR_SETTING_NUMBER, NULL, 0, 1e3, 0}, AT(gyro_range_radps), STORE_DOUBLE},
    {{42, "accel-range", "m/s^2", "the same of the accelerometer", PLR_SETTING_NUMBER, NULL, 0, 1e4, 0}, AT(accel_range_mps2), STORE_DOUBLE},
    {{43, "camera-offset", "s", "added to the time of every frame", PLR_SETTING_NUMBER, NULL, -1, 1, 0}, AT(camera_offset_s), STORE_DOUBLE},
    {{44, "imu-timing", "", "which interval an IMU reading stands for", PLR_SETTING_CHOICE, timing_words, 0, 2, PLR_TWIST_MID}, AT(imu_timing), STORE_U8},
    {{45, "imu-turn", "rad", "rotation vector from the IMU's axes to the body's: x, y, z", PLR_SETTING_NUMBER, NULL, -3.2, 3.2, 0}, AT(imu_turn_rad), STORE_AXES},
    {{46, "imu-turn-y", "rad", "of the y axis alone", PLR_SETTING_NUMBER, NULL, -3.2, 3.2, 0}, AT(imu_turn_rad[1]), STORE_DOUBLE},
    {{47, "imu-turn-z", "rad", "of the z axis alone", PLR_SETTING_NUMBER, NULL, -3.2, 3.2, 0}, AT(imu_turn_rad[2]), STORE_DOUBLE},
    {{48, "imu-arm", "m", "where the IMU is on the body: x, y, z", PLR_SETTING_NUMBER, NULL, -100, 100, 0}, AT(imu_arm_m), STORE_AXES},
    {{49, "imu-arm-y", "m", "along the y axis alone", PLR_SETTING_NUMBER, NULL, -100, 100, 0}, AT(imu_arm_m[1]), STORE_DOUBLE},
    {{50, "imu-arm-z", "m", "along the z axis alone", PLR_SETTING_NUMBER, NULL, -100, 100, 0}, AT(imu_arm_m[2]), STORE_DOUBLE},
    {{51, "focal-sigma", "", "by what share the focal length may be wrong; 0 = exact", PLR_SETTING_NUMBER, NULL, 0, 0.1, 0.005}, AT(focal_sigma), STORE_DOUBLE},
    {{52, "baseline-sigma", "", "the same of the baseline", PLR_SETTING_NUMBER, NULL, 0, 0.1, 0.005}, AT(baseline_sigma), STORE_DOUBLE},
    {{53, "camera-turn-sigma", "rad", "by how much the camera may be turned on the body; 0 = exact", PLR_SETTING_NUMBER, NULL, 0, 0.2, 0.003}, AT(camera_turn_sigma_rad), STORE_DOUBLE},
    {{54, "track-drift", "px/sqrt(s)", "how far tracks wander off their points in a second", PLR_SETTING_NUMBER, NULL, 0, 100, 0}, AT(track_drift_px), STORE_DOUBLE},
    {{55, "scene", "", "may most of what is seen move as one?", PLR_SETTING_CHOICE, scene_words, 0, 1, PLR_SCENE_STANDS}, AT(scene), STORE_U8},
    {{56, "calibrate", "", "parts of the calibration that are estimated on the way", PLR_SETTING_LIST, calibrate_words, 0, 63, 0}, AT(calibrate), STORE_U8},
    {{57, "centre-sigma", "px", "by how much the principal point may be wrong; 0 = exact", PLR_SETTING_NUMBER, NULL, 0, 100, 0}, AT(centre_sigma_px), STORE_DOUBLE},
    {{58, "camera-place-sigma", "m", "by how much the camera's place on the body may be wrong; 0 = exact", PLR_SETTING_NUMBER, NULL, 0, 1, 0}, AT(camera_place_sigma_m), STORE_DOUBLE},
    {{59, "camera-clock-sigma", "s", "by how much the time of frames may be wrong; 0 = exact", PLR_SETTING_NUMBER, NULL, 0, 0.1, 0}, AT(camera_clock_sigma_s), STORE_DOUBLE},
};
/* clang-format on */

enum { COUNT = sizeof rows / sizeof *rows, AXES = 3 };

unsigned plr_setting_count(void) {
    return COUNT;
}

const plr_setting *plr_setting_at(unsigned index) {
    return index < COUNT ? &rows[index].setting : NULL;
}

const plr_setting *plr_setting_by_id(uint8_t id) {
    for (unsigned i = 0; i < COUNT; i++)
        if (rows[i].setting.id == id)
            return &rows[i].setting;
    return NULL;
}

const plr_setting *plr_setting_by_name(const char *name) {
    for (unsigned i = 0; name && i < COUNT; i++)
        if (strcmp(rows[i].setting.name, name) == 0)
            return &rows[i].setting;
    return NULL;
}

static const plr_row *row_of(const plr_setting *setting) {
    for (unsigned i = 0; i < COUNT; i++)
        if (&rows[i].setting == setting)
            return &rows[i];
    return NULL;
}

const plr_setting *plr_setting_axis(const plr_setting *setting, unsigned axis) {
    const plr_row *row = row_of(setting);
    if (!row || row->storage != STORE_AXES)
        return NULL;
    for (unsigned i = 0; axis > 0 && i < COUNT; i++)
        if (rows[i].offset == row->offset + axis * sizeof(double))
            return axis < AXES ? &rows[i].setting : NULL;
    return axis == 0 ? setting : NULL;
}

const plr_setting *plr_setting_of_axis(const plr_setting *setting) {
    for (unsigned i = 0; i < COUNT; i++)
        for (unsigned axis = 1; axis < AXES; axis++)
            if (setting && plr_setting_axis(&rows[i].setting, axis) == setting)
                return &rows[i].setting;
    return NULL;
}

double plr_config_get(const plr_config *config, const plr_setting *setting) {
    const plr_row *row = row_of(setting);
    if (!config || !row)
        return 0;
    const unsigned char *field = (const unsigned char *)config + row->offset;
    uint16_t count;
    double number;
    switch (row->storage) {
    case STORE_U8:
        return *field;
    case STORE_U16:
        memcpy(&count, field, sizeof count);
        return count;
    case STORE_DOUBLE:
    case STORE_AXES:
        memcpy(&number, field, sizeof number);
        return number;
    }
    return 0;
}

static bool is_allowed(const plr_setting *setting, double value) {
    if (!(value >= setting->minimum && value <= setting->maximum))
        return false;
    if (setting->kind == PLR_SETTING_NUMBER)
        return true;
    const double whole = (double)(uint16_t)value; /* the limits of whole ones are below 65536 */
    return whole <= value && whole >= value;
}

plr_status plr_config_set(plr_config *config, const plr_setting *setting, double value) {
    const plr_row *row = row_of(setting);
    if (!config || !row || !is_allowed(setting, value))
        return PLR_E_CONFIG;
    unsigned char *field = (unsigned char *)config + row->offset;
    uint16_t count;
    switch (row->storage) {
    case STORE_U8:
        *field = (uint8_t)value;
        break;
    case STORE_U16:
        count = (uint16_t)value;
        memcpy(field, &count, sizeof count);
        break;
    case STORE_DOUBLE:
        memcpy(field, &value, sizeof value);
        break;
    case STORE_AXES:
        for (unsigned axis = 0; axis < AXES; axis++)
            memcpy(field + axis * sizeof value, &value, sizeof value);
        break;
    }
    return PLR_OK;
}

void plr_config_default(plr_config *config) {
    memset(config, 0, sizeof *config);
    for (unsigned i = 0; i < COUNT; i++)
        (void)plr_config_set(config, &rows[i].setting, rows[i].setting.standard);
}

void plr_config_course(plr_config *config) {
    plr_config_default(config);
    config->model = PLR_MODEL_WORLD;
    config->bias = 0;
    config->twist_timing = PLR_TWIST_START;
    config->noise = PLR_NOISE_STEP;
    config->landmark_sigma_m = 1.4142135623730951; /* variance 2 m^2 */
    config->start_sigma = 0.022360679774997897;    /* variance 5e-4 */
    config->pixel_sigma_px = 2.23606797749979;     /* variance 5 px^2 */
    for (unsigned axis = 0; axis < AXES; axis++) {
        config->velocity_sigma[axis] = 0.03162277660168379; /* variance 1e-3 m^2 a step */
        config->gyro_sigma[axis] = 0.03162277660168379;     /* variance 1e-3 rad^2 a step */
    }
    config->landmark_prior = PLR_PRIOR_INDEPENDENT;
    config->focal_sigma = config->baseline_sigma = 0; /* it knows nothing of such errors */
    config->camera_turn_sigma_rad = 0;
    config->gate_residual_px = 20; /* ours: the report names no limit */
    config->max_depth_m = 30;      /* ours as well */
}

static plr_status refuse(const plr_setting **culprit, const plr_setting *setting) {
    if (culprit)
        *culprit = setting;
    return PLR_E_CONFIG;
}

/* A part of the calibration that shall be estimated and counts as exact; or the list itself, where it
 * is longer than the build allows. */
static const plr_setting *refused_calibration(const plr_config *config) {
    static const char *const sigmas[] = {"focal-sigma",        "baseline-sigma",
                                         "camera-turn-sigma",  "centre-sigma",
                                         "camera-place-sigma", "camera-clock-sigma"};
    static const uint8_t numbers[] = {1, 1, 3, 2, 3, 1}; /* by the bits of plr_calibrate */
    unsigned estimated = 0, all = 0;
    for (unsigned i = 0; i < sizeof numbers; i++) {
        const plr_setting *setting = plr_setting_by_name(sigmas[i]);
        const bool listed = (config->calibrate >> i & 1) != 0;
        const bool exact = plr_config_get(config, setting) <= 0;
        if (listed && exact)
            return setting;
        estimated += listed ? numbers[i] : 0U;
        all += exact ? 0U : numbers[i];
    }
    return estimated > PLR_MAX_CALIBRATION || all > PLR_CALIBRATIONS
               ? plr_setting_by_name("calibrate")
               : NULL;
}

plr_status plr_config_check(const plr_config *config, const plr_setting **culprit) {
    if (culprit)
        *culprit = NULL;
    if (!config)
        return PLR_E_ARGUMENT;
    for (unsigned i = 0; i < COUNT; i++)
        if (!is_allowed(&rows[i].setting, plr_config_get(config, &rows[i].setting)))
            return refuse(culprit, &rows[i].setting);
    if (config->model == PLR_MODEL_BODY && config->landmark_sigma_m > 0)
        return refuse(culprit, plr_setting_by_name("landmark-sigma"));
    if (config->model == PLR_MODEL_WORLD && config->track_drift_px > 0)
        return refuse(culprit, plr_setting_by_name("track-drift"));
    if (config->landmark_prior == PLR_PRIOR_INDEPENDENT) {
        if (config->model == PLR_MODEL_BODY)
            return refuse(culprit, plr_setting_by_name("landmark-prior"));
        if (config->landmark_sigma_m <= 0)
            return refuse(culprit, plr_setting_by_name("landmark-sigma"));
    }
    if (config->process == PLR_PROCESS_IMU && (config->model != PLR_MODEL_BODY || !config->bias))
        return refuse(culprit, plr_setting_by_name("process"));
    const plr_setting *calibrated = refused_calibration(config);
    if (calibrated)
        return refuse(culprit, calibrated);
    if (config->min_depth_m >= config->max_range_m)
        return refuse(culprit, plr_setting_by_name("min-depth"));
    if (config->max_depth_m > 0 && config->min_depth_m >= config->max_depth_m)
        return refuse(culprit, plr_setting_by_name("max-depth"));
    return PLR_OK;
}
