// SPDX-License-Identifier: MIT
/* The rows of the state's blocks in P, laid out once by a process. Three a landmark follow. */
#ifndef PLR_STATE_BLOCKS_H
#define PLR_STATE_BLOCKS_H

#include <stdbool.h>

#include "pelorus/state.h"

/* A block that the process does not estimate has no rows. */
static inline bool plr_has_block(const plr_filter *f, plr_block_id block) {
    return f->belief.layout.block[block].size > 0;
}

static inline unsigned plr_block_size(const plr_filter *f, plr_block_id block) {
    return f->belief.layout.block[block].size;
}

/* The first row of a block. */
static inline unsigned plr_row_of(const plr_filter *f, plr_block_id block) {
    return f->belief.layout.block[block].row;
}

/* Rows of all blocks before the landmarks. */
static inline unsigned plr_core_dim(const plr_filter *f) {
    return f->belief.layout.core;
}

#endif
