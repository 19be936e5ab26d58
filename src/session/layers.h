// SPDX-License-Identifier: MIT
/* The settings in force, from their layers: override over CONFIG over HEADER over default. */
#ifndef PLR_SESSION_LAYERS_H
#define PLR_SESSION_LAYERS_H

#include "pelorus/filter.h"
#include "pelorus/wire.h"

/* The layers above the default. */
typedef struct plr_layers {
    const plr_header *header;
    const plr_config_message *wanted;
    const plr_wire_setting *overrides;
    unsigned override_count;
} plr_layers;

/* *config from the layers. A suggestion of the HEADER that is negative, not a number or outside its
 * setting's limits is left out; with noise = step, so are its velocity and gyro sigmas, which are
 * those of a reading. PLR_E_CONFIG, with the row in *culprit, where the result makes no sense. */
plr_status plr_layers_compose(plr_config *config, const plr_layers *layers,
                              const plr_setting **culprit);

/* True if each value is of a setting, and within its limits. */
bool plr_layers_allow(const plr_wire_setting *values, unsigned count);

/* Adds a CONFIG's value to the wanted ones, or replaces it. PLR_E_CONFIG if no setting has this id
 * or the value is outside its limits: then nothing changes. */
plr_status plr_layers_want(plr_config_message *wanted, plr_wire_setting value);

/* Every setting in force as a CONFIG, with this build's fingerprint. */
void plr_layers_describe(plr_config_message *message, const plr_config *config);

/* True if every value of a CONFIG that this build knows is the one in force. */
bool plr_layers_agree(const plr_config_message *message, const plr_config *config);

#endif
