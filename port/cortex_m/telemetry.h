// SPDX-License-Identifier: MIT
/* The second output: what an autopilot reads, on the second UART. telemetry_mavlink.c is it;
 * telemetry_none.c stands in for it where the image is built without. */
#ifndef PELORUS_CORTEX_M_TELEMETRY_H
#define PELORUS_CORTEX_M_TELEMETRY_H

#include "pelorus/session.h"

/* What the session is to show its frames to. Its HEADER tells the body's axes. */
plr_session_observer telemetry_observer(plr_session *session);

#endif
