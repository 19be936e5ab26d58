// SPDX-License-Identifier: MIT
/* An output file. It is opened before anything is computed, so that a path that cannot be written
 * is reported at once, and every write is checked.
 *
 * It gets its name when it is whole: until then it stands beside it as NAME.part. What fails leaves
 * nothing behind, and what stood there before stays. Devices, pipes and standard output are written
 * to as they stand, and a link keeps pointing at its file. */
#ifndef PELORUS_POSIX_RESULT_FILE_H
#define PELORUS_POSIX_RESULT_FILE_H

#include <stdbool.h>
#include <stdio.h>

enum { RESULT_PATH_SIZE = 4096 + 8 /* of the longest path that Linux takes, and of ".part" */ };

typedef struct result_file {
    const char *path; /* as the user gave it; NULL: not wanted; then every call does nothing */
    FILE *file;
    char target[RESULT_PATH_SIZE]; /* `path` behind its links */
    char part[RESULT_PATH_SIZE];   /* where the bytes go until then; empty: into `path` itself */
} result_file;

/* Makes the file NAME.part. Refuses the input itself, and a file that is there unless `overwrite`.
 * On failure says so on stderr. */
bool result_file_open(result_file *result, const char *path, const char *input_path,
                      bool overwrite);

/* Writes out what is buffered, closes, and gives the file its name. On failure, also an earlier
 * one, says so on stderr. */
bool result_file_close(result_file *result);

/* Closes without a result: nothing of it stays. Nothing to do after result_file_close. */
void result_file_discard(result_file *result);

#endif
