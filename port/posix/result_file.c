// SPDX-License-Identifier: MIT
#include "posix/result_file.h"

#include <errno.h>
#include <string.h>

#include "posix/system.h"

/* Decides on `target` and `part`; false, with errno, where the path cannot be written. */
static bool choose_part(result_file *result) {
    const char *path = result->path;
    result->part[0] = '\0';
    switch (system_output_at(path)) {
    case SYSTEM_AS_IT_STANDS:
        return true;
    case SYSTEM_NEW:
        if (strlen(path) >= sizeof result->target) {
            errno = ENAMETOOLONG;
            return false;
        }
        memcpy(result->target, path, strlen(path) + 1);
        break;
    case SYSTEM_FILE: /* one that is protected stays as it is */
        if (!system_may_write(path) || !system_target(result->target, sizeof result->target, path))
            return false;
        break;
    }
    const int length = snprintf(result->part, sizeof result->part, "%s.part", result->target);
    if (length > 0 && (size_t)length < sizeof result->part)
        return true;
    errno = ENAMETOOLONG;
    return false;
}

bool result_file_open(result_file *result, const char *path, const char *input_path,
                      bool overwrite) {
    result->path = path;
    result->file = NULL;
    if (path == NULL)
        return true;
    const bool chosen = choose_part(result);
    if (system_same_file(path, input_path) ||
        (chosen && system_same_file(result->part, input_path))) {
        fprintf(stderr, PELORUS_NAME ": %s: is the recording itself; give another path\n", path);
        return false;
    }
    if (!overwrite && system_output_at(path) == SYSTEM_FILE) {
        fprintf(stderr, PELORUS_NAME ": %s: is there already; --force overwrites it\n", path);
        return false;
    }
    if (chosen && result->part[0] != '\0')
        system_unfinished(result->part);
    if (chosen)
        result->file = fopen(result->part[0] != '\0' ? result->part : path, "wb");
    if (result->file == NULL) {
        fprintf(stderr, PELORUS_NAME ": %s: cannot be written: %s\n", path, strerror(errno));
        system_released(result->part);
    }
    return result->file != NULL;
}

bool result_file_close(result_file *result) {
    if (result->file == NULL)
        return true;
    errno = 0;
    const bool failed = ferror(result->file) != 0;
    const bool closed = fclose(result->file) == 0;
    result->file = NULL;
    const bool placed =
        !failed && closed &&
        (result->part[0] == '\0' || system_put_in_place(result->part, result->target));
    system_released(result->part);
    if (placed)
        return true;
    fprintf(stderr, PELORUS_NAME ": %s: not wholly written: %s\n", result->path,
            errno != 0 ? strerror(errno) : "an earlier write failed (disk full?)");
    if (result->part[0] != '\0')
        (void)remove(result->part);
    return false;
}

void result_file_discard(result_file *result) {
    if (result->file == NULL)
        return;
    (void)fclose(result->file);
    result->file = NULL;
    if (result->part[0] != '\0')
        (void)remove(result->part);
    system_released(result->part);
}
