// SPDX-License-Identifier: MIT
/* The second output, on the second UART: messages for an autopilot. Implemented by
 * telemetry_mavlink.c, or by telemetry_none.c where the image is built without it. */
#ifndef PELORUS_CORTEX_M_TELEMETRY_H
#define PELORUS_CORTEX_M_TELEMETRY_H

#include "pelorus/session.h"

/* The observer to give the session. The session's HEADER has the body's axes. */
plr_session_observer telemetry_observer(plr_session *session);

#endif
