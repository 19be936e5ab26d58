// SPDX-License-Identifier: MIT
/* The caller's map of known landmarks. */
#ifndef PLR_KNOWN_MAP_LOOKUP_H
#define PLR_KNOWN_MAP_LOOKUP_H

#include <stdbool.h>

#include "pelorus/map.h"
#include "pelorus/settings.h"

/* True in the modes that ask the map source for landmarks, if there is one. */
bool plr_map_is_asked(const plr_config *config, const plr_map *map);

/* Asks it for one. False if it has none, or one that is not valid. */
bool plr_map_ask(const plr_map *map, uint32_t id, plr_landmark *known);

#endif
