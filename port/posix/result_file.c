// SPDX-License-Identifier: MIT
#define _XOPEN_SOURCE 700 /* POSIX with its extensions: realpath */

#include "posix/result_file.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static bool is_same(const struct stat *a, const struct stat *b) {
    return a->st_dev == b->st_dev && a->st_ino == b->st_ino;
}

static bool same_file(const char *a, const char *b) {
    struct stat about_a, about_b;
    return stat(a, &about_a) == 0 && stat(b, &about_b) == 0 && S_ISREG(about_a.st_mode) &&
           is_same(&about_a, &about_b);
}

/* /dev/stdout may be a file: others write to it, too, so it must stay the one that it is. */
static bool is_standard_stream(const struct stat *about) {
    struct stat stream;
    for (int fd = STDOUT_FILENO; fd <= STDERR_FILENO; fd++)
        if (fstat(fd, &stream) == 0 && is_same(&stream, about))
            return true;
    return false;
}

/* The file behind all links into `target`; false where there is none, or no room for its name. */
static bool find_target(char target[RESULT_PATH_SIZE], const char *path) {
    char *found = realpath(path, NULL);
    const bool fits = found != NULL && strlen(found) < RESULT_PATH_SIZE;
    if (fits)
        memcpy(target, found, strlen(found) + 1);
    free(found);
    return fits;
}

/* Decides on `target` and `part`; false, with errno, where the path cannot be written. */
static bool choose_part(result_file *result) {
    struct stat about;
    const char *path = result->path;
    result->part[0] = '\0';
    if (lstat(path, &about) != 0) {
        if (strlen(path) >= sizeof result->target) {
            errno = ENAMETOOLONG;
            return false;
        }
        memcpy(result->target, path, strlen(path) + 1); /* a new file */
    } else {
        if (stat(path, &about) != 0 || !S_ISREG(about.st_mode) || is_standard_stream(&about))
            return true; /* as it stands; also a link to a file that is not there yet */
        if (access(path, W_OK) != 0)
            return false; /* a file that is protected stays as it is */
        if (!find_target(result->target, path))
            return false;
    }
    const int length = snprintf(result->part, sizeof result->part, "%s.part", result->target);
    if (length > 0 && (size_t)length < sizeof result->part)
        return true;
    errno = ENAMETOOLONG;
    return false;
}

bool result_file_open(result_file *result, const char *path, const char *input_path) {
    result->path = path;
    result->file = NULL;
    if (path == NULL)
        return true;
    const bool chosen = choose_part(result);
    if (same_file(path, input_path) || (chosen && same_file(result->part, input_path))) {
        fprintf(stderr, PELORUS_NAME ": %s: is the recording itself; give another path\n", path);
        return false;
    }
    if (chosen)
        result->file = fopen(result->part[0] != '\0' ? result->part : path, "wb");
    if (result->file == NULL)
        fprintf(stderr, PELORUS_NAME ": %s: cannot be written: %s\n", path, strerror(errno));
    return result->file != NULL;
}

/* What is there already keeps its permissions. */
static bool put_in_place(const result_file *result) {
    struct stat before;
    if (result->part[0] == '\0')
        return true;
    if (stat(result->target, &before) == 0)
        (void)chmod(result->part, before.st_mode & 07777);
    return rename(result->part, result->target) == 0;
}

bool result_file_close(result_file *result) {
    if (result->file == NULL)
        return true;
    errno = 0;
    const bool failed = ferror(result->file) != 0;
    const bool closed = fclose(result->file) == 0;
    result->file = NULL;
    if (!failed && closed && put_in_place(result))
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
}
