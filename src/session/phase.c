// SPDX-License-Identifier: MIT
#include "session/phase.h"

#include "math/arrows.h"
#include "pelorus/assertions.h"

/* The arrows of the drawing in docs/REPLAY-FORMAT.md, but for END, which leads back from all. */
static const plr_arrow arrows[] = {
    {PLR_PHASE_WAITING, PLR_TRIGGER_HEADER, PLR_PHASE_READY},
    {PLR_PHASE_READY, PLR_TRIGGER_REJECTED, PLR_PHASE_REJECTED},
    {PLR_PHASE_REJECTED, PLR_TRIGGER_HEADER, PLR_PHASE_READY},
    {PLR_PHASE_REJECTED, PLR_TRIGGER_SETTINGS, PLR_PHASE_READY},
    {PLR_PHASE_READY, PLR_TRIGGER_FILTER, PLR_PHASE_STARTING},
    {PLR_PHASE_STARTING, PLR_TRIGGER_POSE, PLR_PHASE_RUNNING},
    {PLR_PHASE_READY, PLR_TRIGGER_RESTORED, PLR_PHASE_RESTORED},
    {PLR_PHASE_RESTORED, PLR_TRIGGER_RESTORE, PLR_PHASE_READY},
    {PLR_PHASE_RESTORED, PLR_TRIGGER_DATA, PLR_PHASE_RUNNING},
};

void plr_phase_change(plr_session_phase *phase, plr_phase_trigger trigger) {
    PLR_ASSERT(*phase < PLR_PHASES);
    *phase = trigger == PLR_TRIGGER_END
                 ? PLR_PHASE_WAITING
                 : (plr_session_phase)plr_arrow_follow(arrows, sizeof arrows / sizeof *arrows,
                                                       *phase, trigger);
}
