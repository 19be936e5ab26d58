// SPDX-License-Identifier: MIT
#include "posix/state_file.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "pelorus/state_store.h"
#include "posix/system.h"

enum { BLOCK = 4096, LEAST = PLR_STORE_SLOTS * BLOCK, LARGEST = 1 << 30, ERASED = 0xFF };

/* ---------------------------------------------------------------- the device */

static int failed(state_file *file) {
    if (file->error == 0)
        file->error = errno != 0 ? errno : EIO;
    return -1;
}

/* What was written must be on the disk before anything is concluded from reading it back. After a
 * failed fsync a system may forget what it could not write, and call the next one a success. */
static bool synced(state_file *file) {
    if (!file->unsynced)
        return true;
    if (file->lost) {
        errno = file->error;
        return false;
    }
    file->lost = !system_sync(file->fd);
    file->unsynced = file->lost;
    return !file->lost;
}

static int read_bytes(void *context, uint32_t offset, uint8_t *bytes, uint32_t n) {
    state_file *file = context;
    memset(bytes, 0, n);
    if (file->fd < 0)
        return 0;
    errno = 0;
    if (!synced(file))
        return failed(file);
    for (uint32_t done = 0; done < n;) {
        const long piece = system_read_at(file->fd, bytes + done, n - done, offset + done);
        if (piece <= 0)
            return failed(file);
        done += (uint32_t)piece;
    }
    return 0;
}

static int program_bytes(void *context, uint32_t offset, const uint8_t *bytes, uint32_t n) {
    state_file *file = context;
    errno = file->fd < 0 ? EBADF : 0;
    file->unsynced = true;
    for (uint32_t done = 0; done < n;) {
        const long piece = system_write_at(file->fd, bytes + done, n - done, offset + done);
        if (piece <= 0)
            return failed(file);
        done += (uint32_t)piece;
    }
    return 0;
}

static int erase_bytes(void *context, uint32_t offset, uint32_t n) {
    uint8_t blank[BLOCK];
    memset(blank, ERASED, sizeof blank);
    for (uint32_t done = 0; done < n; done += BLOCK)
        if (program_bytes(context, offset + done, blank, BLOCK) != 0)
            return -1;
    return 0;
}

static void prepare(state_file *file, int fd, uint32_t size) {
    *file = (state_file){.fd = fd};
    file->device = (plr_block_device){.context = file,
                                      .size = size,
                                      .erase_size = BLOCK,
                                      .program_size = 1,
                                      .read = read_bytes,
                                      .program = program_bytes,
                                      .erase = erase_bytes};
}

void state_file_none(state_file *file) {
    prepare(file, -1, LEAST);
}

void state_file_close(state_file *file) {
    if (file->fd >= 0)
        close(file->fd);
    file->fd = -1;
}

/* ---------------------------------------------------------------- opening */

/* The store's own mark. */
static bool is_marked(const uint8_t first[4]) {
    return memcmp(first, "PLRS", 4) == 0;
}

/* As a new file or an erase leaves it. */
static bool is_blank(const uint8_t *bytes, uint32_t n) {
    if (bytes[0] != 0 && bytes[0] != ERASED)
        return false;
    for (uint32_t i = 1; i < n; i++)
        if (bytes[i] != bytes[0])
            return false;
    return true;
}

static bool is_blank_from(state_file *file, uint32_t offset) {
    uint8_t bytes[BLOCK];
    for (; offset < file->device.size; offset += BLOCK)
        if (read_bytes(file, offset, bytes, BLOCK) != 0 || !is_blank(bytes, BLOCK))
            return false;
    return true;
}

/* False if it is something else, of which not a byte may be lost. Once a state was saved one of the
 * slots has its mark, whatever is cut; before that, only the first can hold anything. Four zeros
 * alone prove nothing: many a database has them at a page's beginning. */
static bool holds_states(state_file *file) {
    const uint32_t half = file->device.size / 2;
    uint8_t first[4], second[4];
    if (read_bytes(file, 0, first, 4) != 0 || read_bytes(file, half, second, 4) != 0)
        return false;
    return is_marked(first) || is_marked(second) ||
           (is_blank(first, 4) && is_blank_from(file, half));
}

/* What is wrong with an open file; NULL: nothing. */
static const char *trouble(state_file *file, const struct stat *about) {
    if (!S_ISREG(about->st_mode))
        return "is no regular file";
    if (about->st_size < LEAST || about->st_size > LARGEST || about->st_size % LEAST != 0)
        return "is no file of saved states";
    prepare(file, file->fd, (uint32_t)about->st_size);
    return holds_states(file) ? NULL : "is no file of saved states";
}

static bool refuse(state_file *file, char *problem, const char *path, const char *why,
                   const char *instead) {
    snprintf(problem, PROBLEM_SIZE, "%.256s: %s; %s", path, why, instead);
    state_file_close(file);
    return false;
}

bool state_file_open_to_load(state_file *file, const char *path, char problem[PROBLEM_SIZE]) {
    static const char instead[] = "give one that --save-state has written";
    struct stat about;
    state_file_none(file);
    file->fd = system_open_to_read(path);
    if (file->fd < 0 || fstat(file->fd, &about) != 0)
        return refuse(file, problem, path, strerror(errno), instead);
    const char *why = trouble(file, &about);
    return why == NULL || refuse(file, problem, path, why, instead);
}

/* A new file: blank, and as long as it will ever be. */
static bool make(state_file *file, const char *path, uint32_t slot_bytes) {
    const uint32_t slot = (slot_bytes + BLOCK - 1) / BLOCK * BLOCK;
    prepare(file, file->fd, PLR_STORE_SLOTS * slot);
    return ftruncate(file->fd, (off_t)file->device.size) == 0 && system_sync_name(path);
}

bool state_file_open_to_save(state_file *file, const char *path, uint32_t slot_bytes,
                             char problem[PROBLEM_SIZE]) {
    static const char instead[] = "it is left as it is: give another path";
    struct stat about;
    state_file_none(file);
    file->fd = system_open_to_change(path);
    if (file->fd < 0 || fstat(file->fd, &about) != 0)
        return refuse(file, problem, path, strerror(errno), "give a path that can be written");
    if (S_ISREG(about.st_mode) && about.st_size == 0)
        return make(file, path, slot_bytes) ||
               refuse(file, problem, path, strerror(errno), "give a path that can be written");
    const char *why = trouble(file, &about);
    return why == NULL || refuse(file, problem, path, why, instead);
}
