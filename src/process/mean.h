// SPDX-License-Identifier: MIT
#ifndef PLR_PROCESS_MEAN_H
#define PLR_PROCESS_MEAN_H

#include "process/process.h"

/* The mean reading of the step that ends at t_ns with `reading`, by the timing (plr_twist_timing).
 *
 * Between two samples of a signal that changes smoothly its mean is that of both ends. Where a frame
 * came in between, the first part of the interval was bridged by the older one: the second makes up
 * for it, so that the integral is right. Not `bridged` is an interval in which readings were lost:
 * meanwhile frames have corrected what the older one did. */
void plr_mean_reading(const plr_filter *f, uint8_t timing, bool bridged, plr_time_ns t_ns,
                      const plr_real reading[PLR_READING_DIM], plr_real held[PLR_READING_DIM]);

#endif
