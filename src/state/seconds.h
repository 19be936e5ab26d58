// SPDX-License-Identifier: MIT
#ifndef PLR_STATE_SECONDS_H
#define PLR_STATE_SECONDS_H

#include "pelorus/config.h"
#include "pelorus/types.h"

/* ns to s, in the filter's precision. */
static inline plr_real plr_seconds(plr_time_ns ns) {
    return (plr_real)((double)ns * 1e-9);
}

#endif
