// SPDX-License-Identifier: MIT
/* The command line of pelorus-replay. */
#ifndef PELORUS_POSIX_OPTIONS_H
#define PELORUS_POSIX_OPTIONS_H

#include "posix/setting_list.h"

typedef struct replay_options {
    const char *input;                     /* "-" is the standard input; NULL if none was given */
    const char *config, *trajectory, *out; /* paths, NULL where not wanted */
    const char *map_in, *load_state, *save_state;
    bool print_config, answers, json, force, quiet, help, version;

    /* From config file and command line, in the order of their precedence. */
    plr_wire_setting overrides[4 * SETTING_LIST_MAX];
    unsigned override_count;
    plr_start_choice start;
    uint32_t deadline_us;
    const char *without; /* rules of the supervisor that are left out, with commas; NULL: none */
    uint64_t left_out;   /* the same as bits of plr_limit_id */
} replay_options;

/* Reads the command line, and the config file that it names. On false, `problem` says what is wrong
 * and what would be right. */
bool options_parse(replay_options *options, int argc, char *const *argv,
                   char problem[PROBLEM_SIZE]);

/* The long options that are not settings, for the help text; NULL beyond the last. */
typedef struct option_description {
    const char *name;
    const char *value; /* what stands behind it; NULL: nothing does */
    const char *about;
} option_description;

const option_description *options_describe(unsigned index);

#endif
