// SPDX-License-Identifier: MIT
/* From phase to phase: plr_phase_change alone changes a session's phase. */
#ifndef PLR_SESSION_PHASE_H
#define PLR_SESSION_PHASE_H

#include "pelorus/session_parts.h"

/* What can lead to another phase. */
typedef enum plr_phase_trigger {
    PLR_TRIGGER_HEADER,   /* a HEADER begins a drive */
    PLR_TRIGGER_SETTINGS, /* a CONFIG changed what is wanted */
    PLR_TRIGGER_REJECTED, /* HEADER and settings make no filter */
    PLR_TRIGGER_FILTER,   /* the filter was initialised for the data that came */
    PLR_TRIGGER_POSE,     /* it is decided where the pose starts */
    PLR_TRIGGER_RESTORE,  /* a restore begins: it replaces one that was done before */
    PLR_TRIGGER_RESTORED, /* it brought the state back */
    PLR_TRIGGER_DATA,     /* a TWIST, STEREO or TRUTH came */
    PLR_TRIGGER_END       /* END, or what stands for it */
} plr_phase_trigger;

/* The phase that follows; one that leads nowhere from here changes nothing. */
void plr_phase_change(plr_session_phase *phase, plr_phase_trigger trigger);

#endif
