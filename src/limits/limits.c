// SPDX-License-Identifier: MIT
#include "limits/limits.h"

#include <stddef.h>

#define LIMIT(name, value, off, unit, about, scenario, recording) {PLR_R(value), PLR_R(off)},
#define PART(name, value, unit, about, rule)
const plr_real plr_limit_rules[PLR_RULES][2] = {
#include "pelorus/limits.def"
};
#undef LIMIT
#undef PART

#define LIMIT(name, value, off, unit, about, scenario, recording)
#define PART(name, value, unit, about, rule) PLR_R(value),
const plr_real plr_limit_parts[PLR_LIMITS - PLR_RULES] = {
#include "pelorus/limits.def"
};
#undef LIMIT
#undef PART

#define LIMIT(name, value, off, unit, about, scenario, recording)                                  \
    [PLR_LIMIT_##name] = {#name, unit, about, scenario, recording, NULL, value, off},
#define PART(name, value, unit, about, rule)                                                       \
    [PLR_LIMIT_##name] = {#name, unit, about, "part of " rule, "-", rule, value, value},
static const plr_limit_row rows[PLR_LIMITS] = {
#include "pelorus/limits.def"
};

const plr_limit_row *plr_limit_at(unsigned row) {
    return row < PLR_LIMITS ? &rows[row] : NULL;
}
