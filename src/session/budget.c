// SPDX-License-Identifier: MIT
#include "session/budget.h"

void plr_budget_init(plr_budget *budget, uint32_t deadline_us) {
    budget->deadline_ns = (uint64_t)deadline_us * 1000u;
    budget->cost_ns = 0;
}

uint16_t plr_budget_next(const plr_budget *budget) {
    if (budget->deadline_ns == 0)
        return PLR_NO_BUDGET;
    if (budget->cost_ns == 0)
        return PLR_BLOCK_OBSERVATIONS;
    const uint64_t observations = budget->deadline_ns / budget->cost_ns;
    return observations < PLR_NO_BUDGET ? (uint16_t)observations : PLR_NO_BUDGET - 1;
}

void plr_budget_learn(plr_budget *budget, uint64_t elapsed_ns, unsigned used) {
    if (budget->deadline_ns == 0 || elapsed_ns == 0 || used == 0)
        return;
    uint64_t cost = elapsed_ns / used + 1u;
    if (cost > budget->deadline_ns)
        cost = budget->deadline_ns;
    if (cost >= budget->cost_ns)
        budget->cost_ns = cost;
    else
        budget->cost_ns -= (budget->cost_ns - cost + 7u) / 8u;
}
