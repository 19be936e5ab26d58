// SPDX-License-Identifier: MIT
/* One step of a process by a reading that stands for all of its interval. */
#ifndef TESTS_SUPPORT_HELD_STEP_H
#define TESTS_SUPPORT_HELD_STEP_H

#include <string.h>

#include "process/process.h"

static inline void held_step(const plr_process *process, plr_filter *f, plr_time_ns t_ns,
                             const plr_real reading[PLR_READING_DIM], plr_real seconds,
                             plr_real interval) {
    plr_process_step step = {.seconds = seconds, .interval = interval};
    memcpy(step.mean, reading, sizeof step.mean);
    memcpy(step.whole, reading, sizeof step.whole);
    process->step(&f->belief, &f->motion, &f->source, t_ns, &step);
}

#endif
