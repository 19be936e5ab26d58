// SPDX-License-Identifier: MIT
#include "posix/program.h"

#include <stdio.h>

const char program_about[] = "";

void program_capacity(const plr_config *config, char *text, size_t size) {
    snprintf(text, size, "%u slots", (unsigned)config->slots);
}
