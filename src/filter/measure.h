// SPDX-License-Identifier: MIT
/* Readings of the body's twist: of a caller's wheel, or of a standstill that the filter has detected. */
#ifndef PLR_FILTER_MEASURE_H
#define PLR_FILTER_MEASURE_H

#include "pelorus/state.h"

/* Gates a checked reading of the present time, of a sensor of the twist. Where twists move the body it is held
 * until its next reading; where an IMU does, the pending motion is applied and the state corrected. True if
 * it is used; false also where the filter had to recover. */
bool plr_measure_twist(plr_filter *f, const plr_reading *reading, plr_reading_result *result);

#endif
