// SPDX-License-Identifier: MIT
/* Tells the processor to flush subnormal numbers to zero, and not to. */
#ifndef PELORUS_TEST_FLUSH_TO_ZERO_H
#define PELORUS_TEST_FLUSH_TO_ZERO_H

#include <stdbool.h>

/* False if this processor cannot be told. */
bool flush_to_zero(bool on);

#endif
