// SPDX-License-Identifier: MIT
/* A first reading of a recording: how many landmarks a filter that keeps all of them will hold. */
#ifndef PELORUS_TEXTBOOK_CENSUS_H
#define PELORUS_TEXTBOOK_CENSUS_H

#include "pelorus/session.h"
#include "posix/samples.h"

typedef struct census {
    plr_header header;         /* the first; version_major is 0 where there is none */
    plr_config_message wanted; /* what CONFIG messages ask for */
    samples seen;              /* plr_observation */
    unsigned most_seen;        /* observations in a frame */
    unsigned known;            /* LANDMARK messages of role known */
} census;

/* Reads the whole file, "-" being the standard input. False, with errno, if it cannot be opened or
 * read; what is damaged is passed over, as the session passes over it. */
bool census_read(census *c, const char *path);
void census_free(census *c);

/* Ids of which an observation may make a landmark under these settings, and known landmarks where
 * they are asked for. */
unsigned census_landmarks(const census *c, const plr_config *config);

#endif
