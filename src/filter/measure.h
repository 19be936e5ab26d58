// SPDX-License-Identifier: MIT
/* Readings that the filter finds itself: a detected standstill. */
#ifndef PLR_FILTER_MEASURE_H
#define PLR_FILTER_MEASURE_H

#include "pelorus/state.h"

/* Gates a checked reading of the present time, of a sensor of the twist, and holds it. True if it is
 * used. */
bool plr_measure_twist(plr_filter *f, const plr_reading *reading, plr_reading_result *result);

#endif
