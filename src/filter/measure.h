// SPDX-License-Identifier: MIT
/* Readings of small sensors inside the filter: those of the caller, and a detected standstill. */
#ifndef PLR_FILTER_MEASURE_H
#define PLR_FILTER_MEASURE_H

#include "pelorus/state.h"

/* Gates a checked reading of the present time, then applies or holds it. True if it is used. */
bool plr_measure(plr_filter *f, const plr_reading *reading, plr_reading_result *result);

#endif
