// SPDX-License-Identifier: MIT
/* From doubt to doubt: plr_doubt_change alone changes it. */
#ifndef PLR_SUPERVISE_DOUBT_H
#define PLR_SUPERVISE_DOUBT_H

#include "pelorus/supervisor.h"

/* What a frame, or something between frames, says of the pose. */
typedef enum plr_doubt_event {
    PLR_DOUBT_CONTRADICTS, /* pictures contradict the odometry, and it loses weight */
    PLR_DOUBT_DEPARTS,     /* odometry and pictures differ by more than is usual */
    PLR_DOUBT_RETURNS,     /* by no more than is usual */
    PLR_DOUBT_LOSES,       /* something else may have moved the pose, or left it without pictures */
    PLR_DOUBT_SETTLES      /* they have agreed for long enough */
} plr_doubt_event;

/* The state that follows; an event that leads nowhere from here changes nothing. */
void plr_doubt_change(plr_supervisor *s, plr_doubt_event event);

/* True while the odometry has less weight than it states. */
static inline bool plr_doubt_contradicted(const plr_supervisor *s) {
    return s->doubt == PLR_DOUBT_CONTRADICTED;
}

#endif
