// SPDX-License-Identifier: MIT
/* Messages on stderr about faults of the recording: where, what, why. Of each kind only the first
 * few are printed; all are counted. */
#ifndef PELORUS_POSIX_COMPLAINTS_H
#define PELORUS_POSIX_COMPLAINTS_H

#include "pelorus/session.h"

enum {
    COMPLAINT_KINDS = PLR_WIRE_KINDS + 1,
    COMPLAINT_STATUSES = 32, /* status numbers are 0 to -31 */
    COMPLAINT_SKIPS = PLR_SKIP_TOO_LONG + 1
};

typedef struct complaints {
    const char *path;
    bool quiet;
    uint64_t refused[COMPLAINT_KINDS][COMPLAINT_STATUSES];
    uint64_t skipped[COMPLAINT_SKIPS];
    uint64_t spoiled_frames; /* frames with observations that were refused */
} complaints;

/* `path` is the recording's. */
void complaints_init(complaints *c, const char *path, bool quiet);

/* A message was refused; `number` counts those of its kind, from 1. */
void complaints_refused(complaints *c, plr_kind kind, uint32_t number, plr_time_ns t_ns,
                        plr_status status, const plr_setting *culprit);

/* A frame's observations were refused or doubled. */
void complaints_observations(complaints *c, uint32_t number, const plr_report *report);

/* A frame was skipped by the reader. */
void complaints_skipped(complaints *c, const plr_reader *reader);

/* Anything else about the recording. */
void complaints_say(const complaints *c, const char *words);

/* Prints how many more there were. */
void complaints_end(const complaints *c);

#endif
