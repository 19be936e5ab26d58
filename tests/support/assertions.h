// SPDX-License-Identifier: MIT
/* The tests' plr_assertion_failed: says what failed and where, and aborts, unless it is expected. */
#ifndef TESTS_SUPPORT_ASSERTIONS_H
#define TESTS_SUPPORT_ASSERTIONS_H

#include <stdbool.h>

/* Calls a function; true if an assertion failed in it, where it then stopped. */
bool assertion_fails_in(void (*function)(void));

#endif
