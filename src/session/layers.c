// SPDX-License-Identifier: MIT
#include "session/layers.h"

#include "pelorus/assertions.h"

/* With an IMU, where nothing else is said: the prior of its gyro's bias, rad/s, for real parts have so much (the
 * setting's default is for a gyro beside wheels, which has been calibrated); and by how much the times of
 * pictures and readings may differ, s, where a build has room for that column: a trigger and an exposure are
 * hardly known better. */
#define IMU_BIAS_GYRO    0.1
#define IMU_CAMERA_CLOCK (PLR_CALIBRATIONS > 5 ? 2e-3 : 0)

/* An axis without a value of its own has the one for all axes. */
static void suggest_axes(plr_config *config, const char *name, double all, const double axes[3]) {
    const plr_setting *setting = plr_setting_by_name(name);
    PLR_ASSERT(plr_setting_axis(setting, 2) != NULL);
    for (unsigned axis = 0; axis < 3; axis++) {
        const double value = axes[axis] > 0 ? axes[axis] : all;
        if (value >= 0)
            (void)plr_config_set(config, plr_setting_axis(setting, axis), value);
    }
}

/* The densities of an IMU that a HEADER tells are mostly those of a data sheet, of a bare part at rest: they
 * raise what is set by default. To lower it is left to the settings of who knows his IMU. */
static void raise_noises(plr_config *config, const plr_header *header) {
    const struct {
        const char *name;
        double value;
    } densities[] = {
        {"gyro-noise", header->gyro_noise},
        {"accel-noise", header->accel_noise},
        {"gyro-walk", header->gyro_walk},
        {"accel-walk", header->accel_walk},
    };
    for (unsigned i = 0; i < sizeof densities / sizeof densities[0]; i++) {
        const plr_setting *setting = plr_setting_by_name(densities[i].name);
        if (densities[i].value > plr_config_get(config, setting))
            (void)plr_config_set(config, setting, densities[i].value);
    }
}

static void apply_header(plr_config *config, const plr_header *header, bool sigmas_of_a_reading) {
    const double v = header->bias_velocity_sigma_mps, w = header->bias_gyro_sigma_radps;
    const bool has_none = v >= 0 && w >= 0 && header->process == PLR_PROCESS_TWIST;
    const double has_bias = v > 0 || w > 0 ? 1 : has_none ? 0 : -1;
    const struct {
        const char *name;
        double value;
    } suggestions[] = {
        {"twist-timing", header->twist_timing},
        {"pixel-sigma", header->pixel_sigma_px},
        {"bias-velocity-sigma", header->bias_velocity_sigma_mps},
        {"bias-gyro-sigma", header->bias_gyro_sigma_radps},
        {"bias-velocity-walk", header->bias_velocity_walk},
        {"bias-gyro-walk", header->bias_gyro_walk},
        {"process", header->process},
        {"bias-accel-sigma", header->bias_accel_sigma_mps2},
        {"gravity", header->gravity_mps2},
        /* only a sensor that is said to have none does without: else the filter would believe more
         * than it knows */
        {"bias", has_bias},
    };
    for (unsigned i = 0; i < sizeof suggestions / sizeof suggestions[0]; i++)
        if (suggestions[i].value >= 0)
            (void)plr_config_set(config, plr_setting_by_name(suggestions[i].name),
                                 suggestions[i].value);
    raise_noises(config, header);
    if (sigmas_of_a_reading) {
        suggest_axes(config, "velocity-sigma", header->velocity_sigma_mps,
                     header->velocity_sigma_axes_mps);
        suggest_axes(config, "gyro-sigma", header->gyro_sigma_radps, header->gyro_sigma_axes_radps);
    }
}

/* PLR_E_CONFIG if a value is not allowed; *culprit: its setting, NULL if none has its id. */
static plr_status apply_values(plr_config *config, const plr_wire_setting *values, unsigned count,
                               const plr_setting **culprit) {
    for (unsigned i = 0; i < count; i++) {
        const plr_setting *setting = plr_setting_by_id(values[i].id);
        if (setting == NULL || plr_config_set(config, setting, values[i].value) != PLR_OK) {
            *culprit = setting;
            return PLR_E_CONFIG;
        }
    }
    return PLR_OK;
}

/* `process` and `noise` are those that all layers come to: some defaults depend on them. */
static plr_status apply_all(plr_config *config, const plr_layers *layers, uint8_t process,
                            uint8_t noise, const plr_setting **culprit) {
    plr_config_default(config);
    if (process == PLR_PROCESS_IMU) {
        config->bias_gyro_sigma_radps = IMU_BIAS_GYRO;
        config->camera_clock_sigma_s = IMU_CAMERA_CLOCK;
    }
    apply_header(config, layers->header, noise == PLR_NOISE_TWIST);
    plr_status status =
        apply_values(config, layers->wanted->settings, layers->wanted->count, culprit);
    if (status == PLR_OK)
        status = apply_values(config, layers->overrides, layers->override_count, culprit);
    return status;
}

plr_status plr_layers_compose(plr_config *config, const plr_layers *layers,
                              const plr_setting **culprit) {
    *culprit = NULL;
    plr_status status = apply_all(config, layers, PLR_PROCESS_TWIST, PLR_NOISE_TWIST, culprit);
    if (status == PLR_OK)
        status = apply_all(config, layers, config->process, config->noise, culprit);
    return status == PLR_OK ? plr_config_check(config, culprit) : status;
}

bool plr_layers_allow(const plr_wire_setting *values, unsigned count) {
    plr_config scratch;
    const plr_setting *culprit;
    plr_config_default(&scratch);
    return apply_values(&scratch, values, count, &culprit) == PLR_OK;
}

plr_status plr_layers_want(plr_config_message *wanted, plr_wire_setting value) {
    if (!plr_layers_allow(&value, 1))
        return PLR_E_CONFIG;
    const plr_setting *setting = plr_setting_by_id(value.id);
    uint8_t kept = 0;
    PLR_ASSERT(wanted->count <= PLR_WIRE_MAX_SETTINGS);
    for (unsigned i = 0; i < wanted->count; i++) { /* what is set anew goes, for one axis or all */
        const plr_setting *old = plr_setting_by_id(wanted->settings[i].id);
        if (old != setting && plr_setting_of_axis(old) != setting)
            wanted->settings[kept++] = wanted->settings[i];
    }
    wanted->count = kept;
    if (kept == PLR_WIRE_MAX_SETTINGS)
        return PLR_E_CONFIG;
    wanted->settings[wanted->count++] = value;
    return PLR_OK;
}

void plr_layers_describe(plr_config_message *message, const plr_config *config) {
    PLR_ASSERT(plr_setting_count() <= PLR_WIRE_MAX_SETTINGS);
    message->build_fingerprint = plr_build_fingerprint();
    message->max_landmarks = PLR_MAX_LANDMARKS;
    message->max_observations = PLR_MAX_OBSERVATIONS;
    message->block_observations = PLR_BLOCK_OBSERVATIONS;
    message->real_bytes = (uint8_t)sizeof(plr_real);
    message->count = (uint8_t)plr_setting_count();
    for (unsigned i = 0; i < message->count; i++) {
        const plr_setting *setting = plr_setting_at(i);
        message->settings[i].id = setting->id;
        message->settings[i].value = plr_config_get(config, setting);
    }
}

bool plr_layers_agree(const plr_config_message *message, const plr_config *config) {
    for (unsigned i = 0; i < message->count; i++) {
        const plr_setting *setting = plr_setting_by_id(message->settings[i].id);
        if (setting != NULL && plr_config_get(config, setting) != message->settings[i].value)
            return false;
    }
    return true;
}
