// SPDX-License-Identifier: MIT
#include <stdio.h>

#include "posix/cpu.h"
#include "posix/replay.h"

int main(int argc, char **argv) {
    const char *missing = cpu_lacks();
    if (missing != NULL) {
        fprintf(stderr,
                PELORUS_NAME ": this processor lacks %s, and the program was built for "
                             "-march=" PELORUS_ARCH ". Build it with -DPLR_PORTABLE=ON: slower, "
                             "the same bits.\n",
                missing);
        return REPLAY_EXIT_CPU;
    }
    return replay_main(argc, argv);
}
