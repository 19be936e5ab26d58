// SPDX-License-Identifier: MIT
#include "support/assertions.h"

#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>

#include "pelorus/assertions.h"

static jmp_buf way_back;
static bool expected;

void plr_assertion_failed(const char *condition, const char *file, int line) {
    if (expected)
        longjmp(way_back, 1);
    fprintf(stderr, "%s:%d: PLR_ASSERT(%s) failed\n", file, line, condition);
    abort();
}

bool assertion_fails_in(void (*function)(void)) {
    expected = true;
    const bool failed = setjmp(way_back) != 0;
    if (!failed)
        function();
    expected = false;
    return failed;
}
