// SPDX-License-Identifier: MIT
/* The thresholds as numbers. */
#ifndef PLR_SUPERVISE_LIMITS_H
#define PLR_SUPERVISE_LIMITS_H

#include "pelorus/supervisor.h"

/* As they are, and as they are where the rule is left out. */
extern const plr_real plr_limit_values[PLR_LIMITS][2];

static inline plr_real plr_limit(const plr_supervisor *s, plr_limit_id id) {
    return plr_limit_values[id][s->left_out >> id & 1U];
}

/* A limit that counts. */
static inline unsigned plr_limit_count(const plr_supervisor *s, plr_limit_id id) {
    return (unsigned)plr_limit(s, id);
}

#endif
