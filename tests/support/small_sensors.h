// SPDX-License-Identifier: MIT
/* Readings of small sensors on the drive of support/rig.h. */
#ifndef PELORUS_TEST_SMALL_SENSORS_H
#define PELORUS_TEST_SMALL_SENSORS_H

#include "pelorus/types.h"
#include "support/random.h"

extern rng small_sensors_chance;

/* A reading at the rig's time, its value zero; wheel and position sit off the body's origin. */
plr_reading reading_of(plr_sensor sensor, uint8_t axes, double sigma);

/* What a wheel, or a receiver of positions, measures there, with its noise. */
plr_reading wheel(uint8_t axes, double sigma);
plr_reading position(uint8_t axes, double sigma);

/* Gives it to the rig's filter. Demands PLR_OK. */
void measure(plr_reading reading);

/* Sets the rig up for drives on which small sensors matter: uncertain twists, a wide gate. */
void small_sensors_set_up(void);

#endif
