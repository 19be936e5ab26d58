// SPDX-License-Identifier: MIT
/* A test that wrote into a filter on purpose says so: else the next call finds it damaged. */
#ifndef PELORUS_TEST_RESEAL_H
#define PELORUS_TEST_RESEAL_H

#include "filter/guard.h"

static inline void reseal(plr_filter *f) {
    plr_guard_seal_constant(f);
    plr_guard_seal_whole(f);
}

#endif
