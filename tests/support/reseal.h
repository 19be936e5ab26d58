// SPDX-License-Identifier: MIT
/* A test that wrote into a filter on purpose says so: else the next call finds it damaged. */
#ifndef PELORUS_TEST_RESEAL_H
#define PELORUS_TEST_RESEAL_H

#include <math.h>

#include "filter/guard.h"
#include "math/packed.h"

static inline void reseal(plr_filter *f) {
    plr_guard_seal_constant(f);
    plr_guard_seal_whole(f);
}

/* Nothing is known any more of pose, velocity and biases: a filter that has diverged. */
static inline void spoil_covariance(plr_filter *f) {
    for (unsigned i = 0; i < f->belief.layout.core; i++)
        f->belief.P[plr_packed_at(i, i)] = (plr_real)NAN;
    reseal(f);
}

#endif
