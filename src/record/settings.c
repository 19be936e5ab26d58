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
static const char *const calibrate_words[] = {
    "focal", "baseline", "turn", "centre", "place", "clock", "wheel-scale", "wheel-track", NULL};
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

/* A macro's value, as text. */
#define PLR_TEXT_OF(value) PLR_TEXT(value)
#define PLR_TEXT(value)    #value

#define NO_KNOWN_MAP "this build knows no map: build it with PLR_KNOWN_MAP = 1"

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

/* For each part of the calibration, by its bit of plr_calibrate: the setting of its sigma, and how many
 * numbers it has. */
static const char *const part_sigmas[] = {
    "focal-sigma",        "baseline-sigma",     "camera-turn-sigma", "centre-sigma",
    "camera-place-sigma", "camera-clock-sigma", "wheel-scale-sigma", "wheel-track-sigma"};
static const uint8_t part_numbers[] = {1, 1, 3, 2, 3, 1, 1, 1};
enum { PARTS = sizeof part_numbers };

static bool is_exact(const plr_config *config, unsigned part) {
    return plr_config_get(config, plr_setting_by_name(part_sigmas[part])) <= 0;
}

/* The sigma of a part that shall be estimated and counts as exact; NULL: none. */
static const char *exact_and_estimated(const plr_config *config) {
    for (unsigned i = 0; i < PARTS; i++)
        if ((config->calibrate >> i & 1) != 0 && is_exact(config, i))
            return part_sigmas[i];
    return NULL;
}

static bool has_room_for_calibration(const plr_config *config) {
    unsigned estimated = 0, all = 0;
    for (unsigned i = 0; i < PARTS; i++) {
        estimated += (config->calibrate >> i & 1) != 0 ? part_numbers[i] : 0U;
        all += is_exact(config, i) ? 0U : part_numbers[i];
    }
    return estimated <= PLR_MAX_CALIBRATION && all <= PLR_CALIBRATIONS;
}

/* The first combination of values, each within its limits, that no filter takes: why; NULL: none. */
static const char *contradiction(const plr_config *c, const char **culprit) {
    const bool body = c->model == PLR_MODEL_BODY, independent = c->landmark_prior != 0;
    const char *exact = exact_and_estimated(c);
    const struct {
        bool refused;
        const char *setting, *why;
    } rules[] = {
        {body && c->landmark_sigma_m > 0, "landmark-sigma",
         "model = body knows a landmark by its pixels alone: 0, or model = world"},
        {!body && c->track_drift_px > 0, "track-drift",
         "goes with model = body alone; elsewhere 0"},
        {independent && body, "landmark-prior", "independent goes with model = world alone"},
        {independent && c->landmark_sigma_m <= 0, "landmark-sigma",
         "landmark-prior = independent needs one above 0"},
        {c->process == PLR_PROCESS_IMU && (!body || !c->bias), "process",
         "imu needs model = body and bias = on"},
        {c->process != PLR_PROCESS_IMU && c->wheel_scale_sigma > 0, "wheel-scale-sigma",
         "goes with process = imu alone; elsewhere 0"},
        {c->process != PLR_PROCESS_IMU && c->wheel_track_sigma > 0, "wheel-track-sigma",
         "goes with process = imu alone; elsewhere 0"},
        {exact != NULL, exact, "calibrate lists what it belongs to, so it must be above 0"},
        {!has_room_for_calibration(c), "calibrate",
         "more numbers of the calibration are to be estimated, or have a sigma, than this build "
         "has room for: build it with PLR_MAX_CALIBRATION above " PLR_TEXT_OF(
             PLR_MAX_CALIBRATION) ", up to 13"},
        {!PLR_KNOWN_MAP && c->mode == PLR_MODE_LOCALIZATION, "mode", NO_KNOWN_MAP},
        {!PLR_KNOWN_MAP && c->known_map, "known-map", NO_KNOWN_MAP},
        {!PLR_SUPERVISE && c->scene != PLR_SCENE_STANDS, "scene",
         "this build has no supervisor: build it with PLR_SUPERVISE = 1"},
        {c->min_depth_m >= c->max_range_m, "min-depth", "must be below max-range"},
        {c->max_depth_m > 0 && c->min_depth_m >= c->max_depth_m, "max-depth",
         "must be above min-depth, or 0 for no limit"},
    };
    for (unsigned i = 0; i < sizeof rules / sizeof *rules; i++)
        if (rules[i].refused) {
            *culprit = rules[i].setting;
            return rules[i].why;
        }
    return NULL;
}

const char *plr_config_why(const plr_config *config, const plr_setting **culprit) {
    const char *name = NULL, *why = NULL;
    const plr_setting *found = NULL;
    for (unsigned i = 0; i < COUNT && !found; i++)
        if (!is_allowed(&rows[i].setting, plr_config_get(config, &rows[i].setting)))
            found = &rows[i].setting;
    if (found)
        why = "outside its limits";
    else if ((why = contradiction(config, &name)) != NULL)
        found = plr_setting_by_name(name);
    if (culprit)
        *culprit = found;
    return why;
}

plr_status plr_config_check(const plr_config *config, const plr_setting **culprit) {
    if (config)
        return plr_config_why(config, culprit) ? PLR_E_CONFIG : PLR_OK;
    if (culprit)
        *culprit = NULL;
    return PLR_E_ARGUMENT;
}
