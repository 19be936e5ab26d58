// SPDX-License-Identifier: MIT
#include "posix/result_file.h"

#include <errno.h>
#include <string.h>
#include <sys/stat.h>

static bool same_file(const char *a, const char *b) {
    struct stat about_a, about_b;
    return stat(a, &about_a) == 0 && stat(b, &about_b) == 0 && S_ISREG(about_a.st_mode) &&
           about_a.st_dev == about_b.st_dev && about_a.st_ino == about_b.st_ino;
}

bool result_file_open(result_file *result, const char *path, const char *input_path) {
    result->path = path;
    result->file = NULL;
    if (path == NULL)
        return true;
    if (same_file(path, input_path)) {
        fprintf(stderr, PELORUS_NAME ": %s: is the recording itself; give another path\n", path);
        return false;
    }
    result->file = fopen(path, "wb");
    if (result->file == NULL)
        fprintf(stderr, PELORUS_NAME ": %s: cannot be written: %s\n", path, strerror(errno));
    return result->file != NULL;
}

bool result_file_close(result_file *result) {
    if (result->file == NULL)
        return true;
    errno = 0;
    const bool failed = ferror(result->file) != 0;
    const bool closed = fclose(result->file) == 0;
    result->file = NULL;
    if (!failed && closed)
        return true;
    fprintf(stderr, PELORUS_NAME ": %s: not wholly written: %s\n", result->path,
            errno != 0 ? strerror(errno) : "an earlier write failed (disk full?)");
    return false;
}
