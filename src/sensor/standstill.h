// SPDX-License-Identifier: MIT
/* A standstill that pictures show. */
#ifndef PLR_SENSOR_STANDSTILL_H
#define PLR_SENSOR_STANDSTILL_H

#include <stdbool.h>

#include "pelorus/belief.h"
#include "pelorus/camera.h"
#include "pelorus/workspace.h"

/* Looks for a standstill in a frame: true, with the reading, if for a second no pixel moved by more than
 * its noise. sigma_mps: of the velocity at rest, the setting standstill-sigma; 0: none is looked for. */
bool plr_standstill_is_seen(plr_belief *belief, const plr_camera_model *camera,
                            const plr_sightings *sightings, double sigma_mps, plr_reading *reading);

#endif
