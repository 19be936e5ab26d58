// SPDX-License-Identifier: MIT
#include "posix/program.h"

#include <stdio.h>

const char program_about[] = "The filter is the course report's (--preset course) at full size: "
                             "one dense state of pose and\n"
                             "all landmarks, in float64, on OpenBLAS. No landmark is evicted; "
                             "slots and deadline do nothing,\n"
                             "states are not kept, and --model body is not here. It says first how "
                             "much memory it needs, and\n"
                             "exits with 5 where that is not there.\n"
                             "\n";

void program_capacity(const plr_config *config, char *text, size_t size) {
    (void)config;
    snprintf(text, size, "every landmark kept");
}
