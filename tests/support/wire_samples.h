// SPDX-License-Identifier: MIT
/* Messages of every kind, with fields at the ends of their ranges, and how to compare two. */
#ifndef PELORUS_TEST_WIRE_SAMPLES_H
#define PELORUS_TEST_WIRE_SAMPLES_H

#include "pelorus/wire.h"

enum {
    WIRE_SAMPLE_LEAST = 0,  /* everything at the low end, all counts 0 */
    WIRE_SAMPLE_MOST = 1,   /* integers and counts at the high end, reals NaN, infinite, huge */
    WIRE_SAMPLE_COMMON = 2, /* what a recording holds */
    WIRE_SAMPLE_VARIANTS = 3
};

/* A message of the kind. A frame's observations stand in static memory. An END holds zeros: it is
 * the writer that knows the counts. */
plr_message wire_sample(plr_kind kind, unsigned variant);

/* Unity assertion: the same kind and, bit by bit, the same fields. Sequences may differ. */
void wire_assert_same(const plr_message *expected, const plr_message *actual);

#endif
