// SPDX-License-Identifier: MIT
/*
 * Saved states in a file: a block device for plr_state_store (docs/STATE-FORMAT.md). What was written
 * is handed to the disk (fsync) before it is read back, and the store reads everything back: the
 * state before its header, the header before it says that it has saved. So a cut at any moment leaves
 * the old state or the new one.
 */
#ifndef PELORUS_POSIX_STATE_FILE_H
#define PELORUS_POSIX_STATE_FILE_H

#include "pelorus/port.h"
#include "posix/setting_list.h"

typedef struct state_file {
    plr_block_device device; /* to hand to a store */
    int fd;                  /* -1: none is open. Then it reads as blank and takes nothing */
    bool unsynced;           /* something was written since the last fsync */
    bool lost;               /* an fsync failed: what the disk holds is not known any more */
    int error;               /* errno of the first failure; 0: none */
} state_file;

/* No file: a device of the least size. */
void state_file_none(state_file *file);

/* Opens a file of saved states to read. On false, `problem` says what is wrong with it. */
bool state_file_open_to_load(state_file *file, const char *path, char problem[PROBLEM_SIZE]);

/* Opens one to write, or makes one with slots of `slot_bytes`, at least. A file that holds anything
 * else is refused and left as it is. */
bool state_file_open_to_save(state_file *file, const char *path, uint32_t slot_bytes,
                             char problem[PROBLEM_SIZE]);

void state_file_close(state_file *file);

#endif
