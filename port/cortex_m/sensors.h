// SPDX-License-Identifier: MIT
/* A board's own cameras and IMU; chosen by file, as most boards have none. */
#ifndef PELORUS_CORTEX_M_SENSORS_H
#define PELORUS_CORTEX_M_SENSORS_H

#include "pelorus/session.h"

/* What the session says beside the usual, bits of plr_output: a host can replay only what it has seen. */
extern const uint32_t sensors_output;

/* Starts them, in bounded time, with interrupts on. Returns what is wrong, in words for people, or NULL. */
const char *sensors_start(void);

/* Between two steps of the session: hands over what they saw. Returns what went wrong, told once, or NULL. */
const char *sensors_step(plr_session *session);

#endif
