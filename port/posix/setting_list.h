// SPDX-License-Identifier: MIT
/* The settings that one source (the command line, a config file) asks for. */
#ifndef PELORUS_POSIX_SETTING_LIST_H
#define PELORUS_POSIX_SETTING_LIST_H

#include <stddef.h>

#include "pelorus/session.h"

enum {
    SETTING_LIST_MAX = 64,
    PROBLEM_SIZE = 512 /* of a message that says what is wrong */
};

/* What may be asked for besides the rows of the setting table. */
typedef struct setting_list {
    bool course; /* --preset course: under everything else of this source */
    unsigned count;
    plr_wire_setting settings[SETTING_LIST_MAX]; /* one for each id */
    bool start_given, deadline_given;
    plr_start_choice start;
    uint32_t deadline_us;
} setting_list;

/* True if an option of that name (without --) is one that a setting list takes: a row of the table,
 * gate, preset, start or deadline. */
bool setting_list_knows(const char *name);

/* Takes name and value. On false, `problem` says what would be right. The last one of a name
 * wins. */
bool setting_list_put(setting_list *list, const char *name, const char *value,
                      char problem[PROBLEM_SIZE]);

/* Writes what the list asks for behind the `count` overrides that are there (room for
 * SETTING_LIST_MAX more), the preset first; returns the new count. */
unsigned setting_list_append(const setting_list *list, plr_wire_setting *overrides, unsigned count);

#endif
