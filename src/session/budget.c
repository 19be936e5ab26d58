// SPDX-License-Identifier: MIT
#include "session/budget.h"

#include "pelorus/assertions.h"
#include "pelorus/config.h"

void plr_budget_init(plr_budget *budget, uint32_t deadline_us) {
    budget->deadline_ns = (uint64_t)deadline_us * 1000u;
    budget->cost_ns = 0;
    budget->recent_ns[0] = budget->recent_ns[1] = 0;
}

uint16_t plr_budget_next(const plr_budget *budget) {
    if (budget->deadline_ns == 0)
        return PLR_NO_BUDGET;
    if (budget->cost_ns == 0)
        return PLR_BLOCK_OBSERVATIONS;
    const uint64_t observations = budget->deadline_ns / budget->cost_ns;
    return observations < PLR_NO_BUDGET ? (uint16_t)observations : PLR_NO_BUDGET - 1;
}

static uint64_t median3(uint64_t a, uint64_t b, uint64_t c) {
    const uint64_t low = a < b ? a : b, high = a < b ? b : a;
    return c < low ? low : c > high ? high : c;
}

void plr_budget_learn(plr_budget *budget, uint64_t elapsed_ns, unsigned used) {
    if (budget->deadline_ns == 0 || elapsed_ns == 0 || used == 0)
        return;
    uint64_t shown = elapsed_ns / used + 1u;
    if (shown > budget->deadline_ns)
        shown = budget->deadline_ns;
    uint64_t *recent = budget->recent_ns;
    const uint64_t cost = recent[1] == 0 ? shown : median3(shown, recent[0], recent[1]);
    recent[1] = recent[0] == 0 ? shown : recent[0];
    recent[0] = shown;
    if (cost >= budget->cost_ns)
        budget->cost_ns = cost;
    else
        budget->cost_ns -= (budget->cost_ns - cost + 3u) / 4u;
    PLR_ASSERT(budget->cost_ns > 0 && budget->cost_ns <= budget->deadline_ns);
}
