// SPDX-License-Identifier: MIT
#include "telemetry.h"

plr_session_observer telemetry_observer(plr_session *session) {
    const plr_session_observer none = {.context = session};
    return none;
}
