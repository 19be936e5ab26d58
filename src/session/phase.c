// SPDX-License-Identifier: MIT
#include "session/phase.h"

#include "pelorus/assertions.h"

/* The arrows of the drawing in docs/REPLAY-FORMAT.md, but for END, which leads back from all. */
static const struct {
    uint8_t from, trigger, to;
} arrows[] = {
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
    if (trigger == PLR_TRIGGER_END) {
        *phase = PLR_PHASE_WAITING;
        return;
    }
    for (unsigned i = 0; i < sizeof arrows / sizeof arrows[0]; i++)
        if (arrows[i].from == *phase && arrows[i].trigger == trigger) {
            *phase = (plr_session_phase)arrows[i].to;
            return;
        }
}
