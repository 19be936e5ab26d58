// SPDX-License-Identifier: MIT
#include "known_map/lookup.h"

#include <stddef.h>

#include "math/validate.h"

bool plr_map_is_asked(const plr_config *config, const plr_map *map) {
    const bool knows = config->mode == PLR_MODE_LOCALIZATION ||
                       (config->mode == PLR_MODE_SLAM && config->known_map);
    return knows && map->source != NULL;
}

bool plr_map_ask(const plr_map *map, uint32_t id, plr_landmark *known) {
    *known = (plr_landmark){.P_W_m2 = {-1}}; /* refused, if the source fills in nothing */
    return map->source(map->context, id, known) && plr_is_place(known->p_W_m, known->P_W_m2);
}
