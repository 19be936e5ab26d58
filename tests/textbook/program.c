// SPDX-License-Identifier: MIT
#include "posix/program.h"

#include <stdio.h>

const char program_about[] =
    "The filter is the textbook's at full size: one dense state of pose and all "
    "landmarks, in float64,\n"
    "on OpenBLAS. With --preset course it is the course report's. No landmark "
    "is evicted; slots and\n"
    "deadline do nothing, and states are not kept. It says first how much "
    "memory it needs, and exits\n"
    "with 5 where that is not there.\n"
    "\n";

void program_capacity(const plr_config *config, char *text, size_t size) {
    (void)config;
    snprintf(text, size, "every landmark kept");
}
