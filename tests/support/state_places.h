// SPDX-License-Identifier: MIT
/* Where the fields of a saved state stand, by the table that it is made of (filter/snapshot.def): for
 * tests that damage one. That the table is the documented one, test_snapshot.c holds by figures. */
#ifndef PELORUS_TEST_STATE_PLACES_H
#define PELORUS_TEST_STATE_PLACES_H

#include <stdint.h>

/* A field by the names of its table and of itself; of settings and landmarks the first one's. "end"
 * is where such a table ends. The test fails if there is none of that name. */
uint32_t state_place(const char *table, const char *field);

/* The same of a landmark by its number. */
uint32_t state_place_of_landmark(unsigned number, const char *field);

#endif
