// SPDX-License-Identifier: MIT
/*
 * plr_filter_* as include/pelorus/filter.h promises it, by the textbook filter: what the session and
 * the replay call. Of the plr_filter that they hand over nothing is used: the program has one
 * session, and this is its filter. What differs from the library's: every landmark is kept (no slots,
 * no eviction, nothing for the map sink); a state cannot be saved; budgets are not kept, for a desk
 * has time.
 */
#ifndef PELORUS_TEXTBOOK_THE_FILTER_H
#define PELORUS_TEXTBOOK_THE_FILTER_H

#include "pelorus/filter.h"
#include "textbook/textbook.h"

struct the_filter {
    bool ready, clock_started, reading_valid;
    unsigned most_landmarks, most_seen;
    textbook book;
    plr_map map;
    plr_time_ns t_ns, reading_ns;
    double interval_s; /* of the last reading */
    plr_twist reading;
    plr_totals totals;
    unsigned frames_mostly_gated, frames_without_use;
};

extern struct the_filter the;

/* Counts a refusal, and gives its status back. */
plr_status the_filter_refuses(plr_status status);

/* Brings the estimate to a frame's time, by the last reading. */
void the_filter_holds_until(plr_time_ns t_ns);

/* Is a time further ahead than max_gap? */
bool the_filter_finds_a_gap(plr_time_ns t_ns);

#endif
