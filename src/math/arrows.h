// SPDX-License-Identifier: MIT
/* State machines as tables. */
#ifndef PLR_MATH_ARROWS_H
#define PLR_MATH_ARROWS_H

#include <stdint.h>

typedef struct plr_arrow {
    uint8_t from, event, to;
} plr_arrow;

/* The state that follows; an event that leads nowhere from here changes nothing. */
static inline unsigned plr_arrow_follow(const plr_arrow *arrows, unsigned count, unsigned from,
                                        unsigned event) {
    for (unsigned i = 0; i < count; i++)
        if (arrows[i].from == from && arrows[i].event == event)
            return arrows[i].to;
    return from;
}

#endif
