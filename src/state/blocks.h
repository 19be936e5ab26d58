// SPDX-License-Identifier: MIT
/* The rows of the state's blocks in P, laid out once by a process. Three a landmark follow. This header knows
 * where they are and nothing of what stands in them. */
#ifndef PLR_STATE_BLOCKS_H
#define PLR_STATE_BLOCKS_H

#include <stdbool.h>

#include "pelorus/assertions.h"
#include "pelorus/belief.h"

/* A block that the process does not estimate has no rows. */
static inline bool plr_has_block(const plr_belief *belief, plr_block_id block) {
    return belief->layout.block[block].size > 0;
}

static inline unsigned plr_block_size(const plr_belief *belief, plr_block_id block) {
    return belief->layout.block[block].size;
}

/* The first row of a block. */
static inline unsigned plr_row_of(const plr_belief *belief, plr_block_id block) {
    return belief->layout.block[block].row;
}

/* Rows of all blocks before the landmarks. */
static inline unsigned plr_core_dim(const plr_belief *belief) {
    return belief->layout.core;
}

/* The first of the three rows of a landmark. */
static inline unsigned plr_covariance_row(const plr_belief *belief, unsigned slot) {
    PLR_ASSERT(slot <= PLR_MAX_LANDMARKS);
    return plr_core_dim(belief) + PLR_LANDMARK_DIM * slot;
}

/* Rows of P in use: 6 (+ 6) + 3 count. */
static inline unsigned plr_covariance_dim(const plr_belief *belief) {
    return plr_covariance_row(belief, belief->count);
}

/* The leading dimension of V^T in the workspace: dim, rounded up to whole tiles of the kernels. */
static inline unsigned plr_covariance_ld(const plr_belief *belief) {
    const unsigned n = plr_covariance_dim(belief);
    const unsigned ld = (n + PLR_TILE_COLUMNS - 1) / PLR_TILE_COLUMNS * PLR_TILE_COLUMNS;
    PLR_ASSERT(ld <= PLR_MAX_LD);
    return ld;
}

#endif
