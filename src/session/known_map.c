// SPDX-License-Identifier: MIT
#include "session/known_map.h"

#include <string.h>

#include "math/finite.h"
#include "pelorus/assertions.h"

void plr_known_map_init(plr_known_map *map, plr_landmark *memory, unsigned capacity) {
    map->landmarks = memory;
    map->count = 0;
    map->capacity = memory != NULL ? capacity : 0;
}

/* Index of the first landmark whose id is not below this one. */
static unsigned lower_bound(const plr_known_map *map, uint32_t id) {
    unsigned low = 0, high = map->count;
    PLR_ASSERT(map->count <= map->capacity);
    while (low < high) {
        const unsigned middle = low + (high - low) / 2u;
        if (map->landmarks[middle].id < id)
            low = middle + 1u;
        else
            high = middle;
    }
    return low;
}

plr_status plr_known_map_add(plr_known_map *map, const plr_landmark *landmark) {
    if (!plr_all_finite(landmark->p_W_m, 3) || !plr_all_finite(landmark->P_W_m2, 9))
        return PLR_E_NOT_FINITE;
    const unsigned at = lower_bound(map, landmark->id);
    if (at < map->count && map->landmarks[at].id == landmark->id)
        return PLR_E_EXISTS;
    if (map->count >= map->capacity)
        return PLR_E_FULL;
    PLR_ASSERT(at == 0 || map->landmarks[at - 1].id < landmark->id);
    memmove(map->landmarks + at + 1, map->landmarks + at,
            (map->count - at) * sizeof *map->landmarks);
    map->landmarks[at] = *landmark;
    map->landmarks[at].known = true;
    map->count++;
    return PLR_OK;
}

bool plr_known_map_source(void *context, uint32_t id, plr_landmark *landmark) {
    const plr_known_map *map = context;
    const unsigned at = lower_bound(map, id);
    const bool found = at < map->count && map->landmarks[at].id == id;
    if (found)
        *landmark = map->landmarks[at];
    return found;
}
