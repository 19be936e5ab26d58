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

#define SETTING(id, name, unit, about, kind, words, minimum, maximum, standard, field, storage)    \
    {{id, name, unit, PLR_SETTING_##kind, words, minimum, maximum, standard},                      \
     offsetof(plr_config, field),                                                                  \
     STORE_##storage},
static const plr_row rows[] = {
#include "record/settings.def"
};
#undef SETTING

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
