// SPDX-License-Identifier: MIT
#include "known_map/lookup.h"

#include "math/validate.h"

bool plr_map_is_asked(const plr_filter *f) {
    const bool knows = f->config.mode == PLR_MODE_LOCALIZATION ||
                       (f->config.mode == PLR_MODE_SLAM && f->config.known_map);
    return knows && f->map.source != NULL;
}

bool plr_map_ask(const plr_filter *f, uint32_t id, plr_landmark *known) {
    *known = (plr_landmark){.P_W_m2 = {-1}}; /* refused, if the source fills in nothing */
    return f->map.source(f->map.context, id, known) && plr_is_place(known->p_W_m, known->P_W_m2);
}
