// SPDX-License-Identifier: MIT
/* The port's clock, for measuring how long the filter computes. */
#ifndef PLR_SESSION_CLOCK_H
#define PLR_SESSION_CLOCK_H

#include "pelorus/session.h"

/* Now; 0 where the port has no clock. */
static inline uint64_t plr_clock_now_ns(const plr_session *s) {
    return s->port.now_ns != NULL ? s->port.now_ns(s->port.context) : 0;
}

/* Since then; 0 if the clock went back. */
static inline uint64_t plr_clock_elapsed_ns(const plr_session *s, uint64_t since) {
    const uint64_t now = plr_clock_now_ns(s);
    return now > since ? now - since : 0;
}

#endif
