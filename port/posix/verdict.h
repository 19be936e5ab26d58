// SPDX-License-Identifier: MIT
/* Decides whether the replay gave a useful result; if not, prints why on stderr and chooses the
 * exit status. */
#ifndef PELORUS_POSIX_VERDICT_H
#define PELORUS_POSIX_VERDICT_H

#include "posix/setting_list.h"
#include "posix/summary.h"

/* Events of the run that are not in the session or the summary. */
typedef struct outcome {
    bool started;             /* the filter took data */
    bool future;              /* a HEADER of a later version */
    const char *read_problem; /* why reading failed; NULL where all was read */
    plr_status init_status;   /* why the filter did not start */
    char contradiction[256];  /* which setting makes no sense, and why */
    bool foreign_map;         /* the map of --map-in is in another frame */
    char map_problem[PROBLEM_SIZE];
} outcome;

/* Says what is wrong with the file, and gives the status back. */
int verdict_say(const char *path, int status, const char *words);

/* REPLAY_EXIT_OK if the filter was started. */
int verdict_on_recording(const char *path, const plr_session *s, const outcome *run);

/* REPLAY_EXIT_OK if something moved the body, and at least one frame was used. */
int verdict_on_frames(const char *path, const plr_session *s, const summary *summed);

#endif
