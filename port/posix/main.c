// SPDX-License-Identifier: MIT
#include <stdio.h>

#include "posix/processor.h"
#include "posix/replay.h"
#include "posix/system.h"

int main(int argc, char **argv) {
    const char *missing = processor_lacks();
    if (missing != NULL) {
        fprintf(stderr,
                PELORUS_NAME ": this processor lacks %s, and the program was built for "
                             "-march=" PELORUS_ARCH ". Build it with -DPLR_PORTABLE=ON: slower, "
                             "the same bits.\n",
                missing);
        return REPLAY_EXIT_CPU;
    }
    system_begin();
    return replay_main(argc, argv);
}
