// SPDX-License-Identifier: MIT
/* On a board, whose kernel's tile is 6 columns wide, a state of 15 + 3 x 32 rows had rows of 114 numbers
 * in arrays of 112: what lay behind was overwritten, and the filter diverged when all slots were full. */
#include <unity.h>

#include "pelorus/config.h"

static void test_rows_fit_whatever_the_width_of_the_tile(void) {
    for (unsigned width = 1; width <= 16; width++) {
        if (16 % width != 0 && 6 % width != 0)
            continue; /* config.h refuses it */
        const unsigned ld = (PLR_MAX_STATE + width - 1) / width * width;
        TEST_ASSERT_LESS_OR_EQUAL_UINT(PLR_MAX_LD, ld);
    }
}
