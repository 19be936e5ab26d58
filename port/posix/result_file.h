// SPDX-License-Identifier: MIT
/* An output file. It is opened before anything is computed, so that a path that cannot be written
 * is reported at once, and every write is checked. */
#ifndef PELORUS_POSIX_RESULT_FILE_H
#define PELORUS_POSIX_RESULT_FILE_H

#include <stdbool.h>
#include <stdio.h>

typedef struct result_file {
    const char *path; /* NULL: not wanted; then every call does nothing and succeeds */
    FILE *file;
} result_file;

/* Creates or empties the file. Refuses the input itself. On failure says so on stderr. */
bool result_file_open(result_file *result, const char *path, const char *input_path);

/* Writes out what is buffered, and closes. On failure, also an earlier one, says so on stderr. */
bool result_file_close(result_file *result);

#endif
