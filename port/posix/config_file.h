// SPDX-License-Identifier: MIT
/* Config files: lines `name = value`, names as the long options; # begins a comment. */
#ifndef PELORUS_POSIX_CONFIG_FILE_H
#define PELORUS_POSIX_CONFIG_FILE_H

#include "posix/setting_list.h"

/* Reads a file into the list. On false, `problem` names file, line, and what would be right. */
bool config_file_read(const char *path, setting_list *list, char problem[PROBLEM_SIZE]);

/* Writes the settings as such a file, with unit and meaning behind each. */
void config_file_print(const plr_config *config);

#endif
