// SPDX-License-Identifier: MIT
/*
 * Tests whether what is seen agrees with itself: how many observations the gate rejects, and how far the
 * others are off, over the last frames and beside what is usual on this drive (docs/MATH.md 17).
 */
#ifndef PLR_FILTER_SCENE_H
#define PLR_FILTER_SCENE_H

#include "pelorus/state.h"
#include "pelorus/types.h"

typedef enum plr_scene_verdict {
    PLR_SCENE_AGREES,
    PLR_SCENE_WORSE, /* suddenly its observations fit worse than usual; noise does that at times, too */
    PLR_SCENE_SPLIT /* a large share is rejected */
} plr_scene_verdict;

/* Start: nothing seen, and much counts as usual. */
void plr_scene_clear(plr_filter *f);

/* Adds the counts of a frame. */
plr_scene_verdict plr_scene_add(plr_filter *f, const plr_report *report);

/* PLR_REASON_NIS_HIGH, PLR_REASON_NIS_LOW or 0: whether the noise settings suit what is seen. */
uint32_t plr_scene_noise_reasons(const plr_filter *f);

#endif
