// SPDX-License-Identifier: MIT
/* What operating systems do not have in common, of what the replay needs of files: system_posix.c or
 * system_windows.c. A function that returns false has set errno. */
#ifndef PELORUS_POSIX_SYSTEM_H
#define PELORUS_POSIX_SYSTEM_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Before anything is read or written: the standard streams carry bytes as they are. */
void system_begin(void);

/* A descriptor for bytes as they are, or -1. */
int system_open_to_read(const char *path);
int system_open_to_change(
    const char *path); /* reads and writes; makes the file where there is none */

/* The next bytes of what is open; bytes at an offset of it. Their number, 0 at the end, or -1. */
long system_read(int fd, void *bytes, size_t n);
long system_read_at(int fd, void *bytes, size_t n, uint64_t offset);
long system_write_at(int fd, const void *bytes, size_t n, uint64_t offset);

/* What was written is on the disk; so is the name of a new file. Not every file system can be asked
 * for the latter: that is no failure. */
bool system_sync(int fd);
bool system_sync_name(const char *path);

/* Do both exist, and are they one regular file? */
bool system_same_file(const char *a, const char *b);

/* What a path stands for that is to be written. */
typedef enum system_output {
    SYSTEM_NEW,         /* nothing is there yet */
    SYSTEM_FILE,        /* a regular file, to be replaced when the new one is whole */
    SYSTEM_AS_IT_STANDS /* a device, a pipe, a link to nothing, or what standard output goes to */
} system_output;

system_output system_output_at(const char *path);

/* May the file be written? */
bool system_may_write(const char *path);

/* The file behind all links, into target[size]. */
bool system_target(char *target, size_t size, const char *path);

/* Should Ctrl-C, or another signal that ends programs, end this one, the file goes with it; until it
 * is released. The name must stay until then. Of more than SYSTEM_UNFINISHED_MOST files, and of all
 * on Windows and WASI, nothing is kept: there it stays. */
enum { SYSTEM_UNFINISHED_MOST = 8 };
void system_unfinished(const char *part);
void system_released(const char *part);

/* `part` becomes `target`, in one step; it takes on the permissions of what stood there. */
bool system_put_in_place(const char *part, const char *target);

#endif
