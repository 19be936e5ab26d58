// SPDX-License-Identifier: MIT
/* What pictures say by themselves: one that repeats the last, a gate that rejects nearly all or nothing,
 * frames without a point, innovations beside their noise. */
#ifndef PLR_SUPERVISE_PICTURES_H
#define PLR_SUPERVISE_PICTURES_H

#include "pelorus/supervisor.h"

/* False of a frozen picture, which would hold a moving body: it repeats the last one, though the body has moved
 * by more than noise. */
bool plr_pictures_show_present(plr_supervisor *s, const plr_picture_evidence *e);

/* True after a lock, or after ten frames without a used observation, until one is used: a gate of fixed width
 * would reject everything for ever. */
bool plr_pictures_open_fixed_gate(const plr_supervisor *s);

/* True if the picture repeats an older one, and others that did so were used before the body was seen to have moved. */
bool plr_pictures_misled(const plr_supervisor *s);

/* True if the gate rejects nearly all of a frame. */
bool plr_pictures_reject_all(const plr_supervisor *s, unsigned matched, unsigned gated);

/* Counts a gate that rejects nearly all. True if it has done so for ten frames, and after each further
 * ten. */
bool plr_pictures_lock(plr_supervisor *s, unsigned matched, unsigned gated);

/* Adds a frame's counts. Returns bits of plr_reason. */
uint32_t plr_pictures_add(plr_supervisor *s, const plr_report *report, plr_time_ns t_ns,
                          bool has_gate);

#endif
