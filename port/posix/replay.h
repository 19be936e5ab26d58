// SPDX-License-Identifier: MIT
/* pelorus-replay: runs the session over a recording and evaluates the result. */
#ifndef PELORUS_POSIX_REPLAY_H
#define PELORUS_POSIX_REPLAY_H

/* Exit statuses; the help text says what they mean. */
enum {
    REPLAY_EXIT_OK = 0,
    REPLAY_EXIT_RECORDING = 1,
    REPLAY_EXIT_USAGE = 2,
    REPLAY_EXIT_OUTPUT = 3,
    REPLAY_EXIT_CPU = 4
};

int replay_main(int argc, char **argv);

#endif
