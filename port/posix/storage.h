// SPDX-License-Identifier: MIT
/* The session's store on a desktop: it reads from one file (--load-state) until the drive has begun,
 * and from there on saves into another (--save-state), which may be the same. */
#ifndef PELORUS_POSIX_STORAGE_H
#define PELORUS_POSIX_STORAGE_H

#include "pelorus/session.h"
#include "posix/options.h"
#include "posix/state_file.h"

typedef struct storage {
    state_file load, save;
    plr_state_store store;
    bool begun;                          /* no more is read from `load` */
    plr_status load_status, save_status; /* why the options' files gave or took no state */
} storage;

/* Opens what the options name. Gives an exit status, and says on stderr what is wrong. */
int storage_open(storage *s, const replay_options *wanted);

void storage_close(storage *s);

/* Sets store, start and output in the session's options. */
void storage_lend(storage *s, const replay_options *wanted, plr_session_options *options);

/* The first data has been taken, or the drive ends: saves go into the other file. May be called
 * again. */
void storage_begin(storage *s);

/* What the files of --load-state and --save-state came to: an exit status, and why on stderr. */
int storage_verdict_on_load(const storage *s, const replay_options *wanted);
int storage_verdict_on_save(const storage *s, const replay_options *wanted);

#endif
