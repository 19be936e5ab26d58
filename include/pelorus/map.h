// SPDX-License-Identifier: MIT
#ifndef PELORUS_MAP_H
#define PELORUS_MAP_H

#include <stdbool.h>
#include <stdint.h>

#include "pelorus/types.h"

/* The caller's store of landmarks outside the filter. Both functions may be NULL. They must not
 * call the filter. */
typedef struct plr_map {
    void *context;
    /* Stores a landmark that leaves the filter. Returns 0; else the filter keeps it. */
    int (*sink)(void *context, const plr_landmark *landmark);
    /* Looks up an id: fills position, covariance and id and returns true, or returns false. A frame may ask
     * for an id several times, and for those of known landmarks that it does not see. */
    bool (*source)(void *context, uint32_t id, plr_landmark *landmark);
} plr_map;

#endif
