// SPDX-License-Identifier: MIT
/* CMake takes this file where the system is not Windows. */
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "posix/system.h"

#ifdef __wasi__ /* has no signals */
static void remove_at_signals(void) {
}
static const char *unfinished[SYSTEM_UNFINISHED_MOST];
#else
#include <signal.h>

static const char *volatile unfinished[SYSTEM_UNFINISHED_MOST];

/* Calls nothing but what a signal's handler may (POSIX 2.4.3); behind it the signal does its work. */
static void remove_unfinished(int signal) {
    for (int i = 0; i < SYSTEM_UNFINISHED_MOST; i++)
        if (unfinished[i] != NULL)
            (void)unlink(unfinished[i]);
    (void)raise(signal);
}

/* Those that are ignored, as by nohup, stay so. */
static void remove_at_signals(void) {
    static const int signals[] = {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGPIPE, SIGXCPU, SIGXFSZ};
    struct sigaction action = {.sa_handler = remove_unfinished};
    action.sa_flags = (int)SA_RESETHAND; /* raised anew it is not caught */
    (void)sigemptyset(&action.sa_mask);
    for (unsigned i = 0; i < sizeof signals / sizeof signals[0]; i++) {
        struct sigaction before;
        if (sigaction(signals[i], NULL, &before) == 0 && before.sa_handler != SIG_IGN)
            (void)sigaction(signals[i], &action, NULL);
    }
}
#endif

void system_begin(void) {
    remove_at_signals();
}

static void exchange(const char *is, const char *becomes) {
    for (int i = 0; i < SYSTEM_UNFINISHED_MOST; i++)
        if (unfinished[i] == is) {
            unfinished[i] = becomes;
            return;
        }
}

void system_unfinished(const char *part) {
    exchange(NULL, part);
}

void system_released(const char *part) {
    exchange(part, NULL);
}

int system_open_to_read(const char *path) {
    return open(path, O_RDONLY);
}

int system_open_to_change(const char *path) {
    return open(path, O_RDWR | O_CREAT, 0666);
}

long system_read(int fd, void *bytes, size_t n) {
    ssize_t count;
    do
        count = read(fd, bytes, n);
    while (count < 0 && errno == EINTR);
    return (long)count;
}

long system_read_at(int fd, void *bytes, size_t n, uint64_t offset) {
    ssize_t count;
    do
        count = pread(fd, bytes, n, (off_t)offset);
    while (count < 0 && errno == EINTR);
    return (long)count;
}

long system_write_at(int fd, const void *bytes, size_t n, uint64_t offset) {
    ssize_t count;
    do
        count = pwrite(fd, bytes, n, (off_t)offset);
    while (count < 0 && errno == EINTR);
    return (long)count;
}

bool system_sync(int fd) {
    return fsync(fd) == 0;
}

/* A file's name is on the disk when its folder is. */
bool system_sync_name(const char *path) {
    char folder[PATH_MAX] = ".";
    const char *name = strrchr(path, '/');
    if (name != NULL)
        snprintf(folder, sizeof folder, "%.*s", (int)(name - path + 1), path);
    const int fd = open(folder, O_RDONLY | O_DIRECTORY);
    if (fd < 0)
        return false;
    const bool done = fsync(fd) == 0 || errno == EINVAL;
    const int why = errno;
    close(fd);
    errno = why;
    return done;
}

static bool is_same(const struct stat *a, const struct stat *b) {
    return a->st_dev == b->st_dev && a->st_ino == b->st_ino;
}

bool system_same_file(const char *a, const char *b) {
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

system_output system_output_at(const char *path) {
    struct stat about;
    if (lstat(path, &about) != 0)
        return SYSTEM_NEW;
    const bool file =
        stat(path, &about) == 0 && S_ISREG(about.st_mode) && !is_standard_stream(&about);
    return file ? SYSTEM_FILE : SYSTEM_AS_IT_STANDS;
}

bool system_may_write(const char *path) {
    return access(path, W_OK) == 0;
}

bool system_target(char *target, size_t size, const char *path) {
    char *found = realpath(path, NULL);
    if (found == NULL)
        return false;
    const size_t length = strlen(found);
    const bool fits = length < size;
    if (fits)
        memcpy(target, found, length + 1);
    free(found);
    if (!fits)
        errno = ENAMETOOLONG;
    return fits;
}

bool system_put_in_place(const char *part, const char *target) {
    struct stat before;
    if (stat(target, &before) == 0)
        (void)chmod(part, before.st_mode & 07777);
    return rename(part, target) == 0;
}
