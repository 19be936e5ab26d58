// SPDX-License-Identifier: MIT
/* Readings of small sensors that the filter finds itself. */
#ifndef PLR_FILTER_MEASURE_H
#define PLR_FILTER_MEASURE_H

#include "pelorus/state.h"

/* A checked reading of the filter's present time: gated, then applied or held. True if it is used. */
bool plr_measure(plr_filter *f, const plr_reading *reading, plr_reading_result *result);

#endif
