// SPDX-License-Identifier: MIT
#include "supervise/limits.h"

#include <stddef.h>

#define LIMIT(name, value, off, unit, about, scenario, recording) {PLR_R(value), PLR_R(off)},
const plr_real plr_limit_values[PLR_LIMITS][2] = {
#include "pelorus/limits.def"
};
#undef LIMIT

#define LIMIT(name, value, off, unit, about, scenario, recording)                                  \
    {#name, unit, about, scenario, recording, value, off},
static const plr_limit_row rows[PLR_LIMITS] = {
#include "pelorus/limits.def"
};
#undef LIMIT

const plr_limit_row *plr_limit_at(unsigned row) {
    return row < PLR_LIMITS ? &rows[row] : NULL;
}
