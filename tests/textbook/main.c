// SPDX-License-Identifier: MIT
/*
 * pelorus-textbook: the textbook's filter at full size, over a recording. Reads the recording
 * twice: first to see how many landmarks there will be, and so how much memory it needs; then as
 * pelorus-replay does, whose program it is but for the filter.
 */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "posix/map_in.h"
#include "posix/options.h"
#include "posix/replay.h"
#include "posix/verdict.h"
#include "session/layers.h"
#include "textbook/census.h"
#include "textbook/program.h"

enum { EXIT_MEMORY = 5 };

static const double GB = 1e9;

static int usage_error(const char *problem) {
    fprintf(stderr, PELORUS_NAME ": %s\n", problem);
    return REPLAY_EXIT_USAGE;
}

/* The standard input cannot be read twice: from here on it is a file without a name. */
static bool keep_standard_input(void) {
    char piece[1 << 16];
    FILE *kept = tmpfile();
    if (kept == NULL)
        return false;
    for (ssize_t n; (n = read(STDIN_FILENO, piece, sizeof piece)) != 0;)
        if (n < 0 || fwrite(piece, 1, (size_t)n, kept) != (size_t)n)
            return false;
    return fflush(kept) == 0 && dup2(fileno(kept), STDIN_FILENO) == STDIN_FILENO &&
           lseek(STDIN_FILENO, 0, SEEK_SET) == 0;
}

/* Tells the memory that the filter will take; an exit status where it is not there. */
static int reserve(const replay_options *o, const census *c, const plr_config *config) {
    const unsigned landmarks = census_landmarks(c, config);
    const size_t bytes = textbook_bytes(config, landmarks, c->most_seen);
    const size_t there = textbook_program_memory();
    if (!o->quiet)
        fprintf(stderr,
                "%s: up to %u landmarks, all of them kept: P is %u x %u numbers, and it takes "
                "%.2f GB; %.2f GB can be had\n",
                o->input, landmarks, 3 * landmarks + 6, 3 * landmarks + 6, (double)bytes / GB,
                (double)there / GB);
    if (bytes > there) {
        fprintf(stderr,
                PELORUS_NAME ": %s: not enough memory: %.2f GB are needed and %.2f GB can be had. "
                             "--max-depth leaves out far landmarks; pelorus-replay-f64 keeps as "
                             "many as it has slots\n",
                o->input, (double)bytes / GB, (double)there / GB);
        return EXIT_MEMORY;
    }
    textbook_program_reserve(landmarks, c->most_seen);
    return REPLAY_EXIT_OK;
}

/* The first reading. A recording of which nothing can be made is for the second to explain. */
static int look_ahead(const replay_options *o, census *c) {
    plr_config config;
    map_in map;
    char problem[PROBLEM_SIZE];
    const plr_setting *culprit;
    const plr_layers layers = {&c->header, &c->wanted, o->overrides, o->override_count};
    if (o->load_state != NULL || o->save_state != NULL)
        return usage_error("the textbook keeps no states: leave out --load-state and --save-state");
    if (strcmp(o->input, "-") == 0 && !keep_standard_input())
        return verdict_say(o->input, REPLAY_EXIT_RECORDING, strerror(errno));
    if (!census_read(c, o->input))
        return verdict_say(o->input, REPLAY_EXIT_RECORDING, strerror(errno));
    if (strcmp(o->input, "-") == 0 && lseek(STDIN_FILENO, 0, SEEK_SET) != 0)
        return verdict_say(o->input, REPLAY_EXIT_RECORDING, strerror(errno));
    if (c->header.version_major == 0 || plr_layers_compose(&config, &layers, &culprit) != PLR_OK)
        return REPLAY_EXIT_OK;
    const bool mapped = map_in_read(&map, o->map_in, problem);
    c->known += (unsigned)map.landmarks.count;
    map_in_free(&map);
    if (!mapped)
        return usage_error(problem);
    return o->print_config ? REPLAY_EXIT_OK : reserve(o, c, &config);
}

int main(int argc, char **argv) {
    static replay_options options;
    static census counted;
    char problem[PROBLEM_SIZE];
    int status = REPLAY_EXIT_OK;
    if (options_parse(&options, argc, argv, problem) && options.input != NULL && !options.help &&
        !options.version)
        status = look_ahead(&options, &counted);
    census_free(&counted);
    return status == REPLAY_EXIT_OK ? replay_main(argc, argv) : status;
}
