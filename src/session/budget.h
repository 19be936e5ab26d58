// SPDX-License-Identifier: MIT
/*
 * A deadline in time becomes a budget of observations.
 *
 * Let c be the cost of one observation. A frame that used n > 0 of them and took t shows t / n, but
 * at most the deadline. Of the last three frames the median counts, so that an interrupted one says
 * nothing; c rises to it at once, and falls towards it by a quarter of the difference. The next
 * frame may use deadline / c, at least one; one block of them until a cost is known. Where time is
 * linear in n, the budget settles at the largest n that keeps the deadline. It is in the echoed
 * STEREO, so a replay of the log takes the same observations on any machine.
 */
#ifndef PLR_SESSION_BUDGET_H
#define PLR_SESSION_BUDGET_H

#include "pelorus/session_parts.h"

/* deadline_us = 0: no limit. */
void plr_budget_init(plr_budget *budget, uint32_t deadline_us);

/* Observations that the next frame may use; PLR_NO_BUDGET without a deadline. */
uint16_t plr_budget_next(const plr_budget *budget);

/* What a frame took. elapsed_ns = 0, a stalled or missing clock, teaches nothing. */
void plr_budget_learn(plr_budget *budget, uint64_t elapsed_ns, unsigned used);

#endif
