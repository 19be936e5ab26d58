// SPDX-License-Identifier: MIT
/* A saved state in memory, with the faults that a sink or a source can have. */
#ifndef PELORUS_TEST_STATE_BYTES_H
#define PELORUS_TEST_STATE_BYTES_H

#include "pelorus/filter.h"

enum { STATE_BYTES_MAX = 1 << 16 };

typedef struct state_bytes {
    uint8_t bytes[STATE_BYTES_MAX];
    uint32_t length;
    /* Faults; all off when zero. */
    unsigned fails_at; /* number of the call that fails, from 1 */
    unsigned flips_at; /* number of the read in which the first byte comes with a flipped bit */
    /* What happened. */
    unsigned calls;
    uint32_t next;         /* where the next read in order would be */
    bool out_of_order;     /* a read was neither next in order nor at the beginning */
    unsigned most_at_once; /* bytes in the longest call */
} state_bytes;

/* plr_state_sink and plr_state_source over a state_bytes. */
int state_bytes_take(void *context, const uint8_t *bytes, uint32_t n);
int state_bytes_give(void *context, uint32_t offset, uint8_t *bytes, uint32_t n);

/* Saves into an emptied state_bytes without faults, and expects it to succeed. */
void state_bytes_save(state_bytes *state, const plr_filter *f);

/* Restores from it, counting calls from 1 again. */
plr_status state_bytes_restore(state_bytes *state, plr_filter *f);

bool state_bytes_same(const state_bytes *a, const state_bytes *b);

/* Is every byte of the filter the same, but for the workspace and what lies behind the landmarks in
 * use? Counts are looked at too. */
bool state_bytes_same_filter(const plr_filter *a, const plr_filter *b);

#endif
