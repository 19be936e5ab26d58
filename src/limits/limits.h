// SPDX-License-Identifier: MIT
/* The thresholds of detection as numbers (pelorus/limits.def). `left_out`: the rules that are left out, as
 * plr_filter_leave_out has them. */
#ifndef PLR_LIMITS_LIMITS_H
#define PLR_LIMITS_LIMITS_H

#include "pelorus/supervisor.h"

/* Of each rule as it is, and as it is where it is left out; of their parts. */
extern const plr_real plr_limit_rules[PLR_RULES][2];
extern const plr_real plr_limit_parts[PLR_LIMITS - PLR_RULES];

static inline plr_real plr_limit(uint64_t left_out, plr_limit_id id) {
    return id < PLR_RULES ? plr_limit_rules[id][left_out >> id & 1U]
                          : plr_limit_parts[id - PLR_RULES];
}

/* A limit that counts. */
static inline unsigned plr_limit_count(uint64_t left_out, plr_limit_id id) {
    return (unsigned)plr_limit(left_out, id);
}

/* A time, of one in ms. */
static inline plr_time_ns plr_limit_ns(uint64_t left_out, plr_limit_id id) {
    return (plr_time_ns)plr_limit(left_out, id) * UINT64_C(1000000);
}

#endif
