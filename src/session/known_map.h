// SPDX-License-Identifier: MIT
/* Landmarks of known position, in the caller's memory, ascending by id: the filter's map source. */
#ifndef PLR_SESSION_KNOWN_MAP_H
#define PLR_SESSION_KNOWN_MAP_H

#include "pelorus/session_parts.h"

void plr_known_map_init(plr_known_map *map, plr_landmark *memory, unsigned capacity);

/* Adds a landmark. PLR_E_NOT_FINITE; PLR_E_EXISTS a landmark of this id; PLR_E_FULL. */
plr_status plr_known_map_add(plr_known_map *map, const plr_landmark *landmark);

/* plr_map.source over a plr_known_map as context: the landmark of that id, by binary search. */
bool plr_known_map_source(void *context, uint32_t id, plr_landmark *landmark);

#endif
