// SPDX-License-Identifier: MIT
/* Landmarks as the caller sees them: in the world, in and out. */
#include "filter/filter_internal.h"
#include "filter/guard.h"
#include "math/finite.h"
#include "process/alignment.h"
#include "process/process.h"
#include "state/model.h"
#include "state/slots.h"

unsigned plr_filter_landmark_count(const plr_filter *f) {
    return plr_guard_check(f) == PLR_OK ? f->belief.count : 0;
}

plr_status plr_filter_landmark(plr_filter *f, unsigned slot, plr_landmark *landmark) {
    const plr_status sound = landmark ? plr_guard_check_whole(f) : PLR_E_ARGUMENT;
    if (sound != PLR_OK)
        return sound;
    if (slot >= f->belief.count)
        return PLR_E_ARGUMENT;
    plr_landmark found;
    if (!plr_slots_export(&f->belief, &f->camera, &f->motion, slot, &found))
        return PLR_E_DIVERGED;
    *landmark = found;
    return PLR_OK;
}

plr_status plr_filter_insert_known(plr_filter *f, const plr_landmark *landmark) {
    const plr_status sound = landmark ? plr_guard_check_whole(f) : PLR_E_ARGUMENT;
    if (sound != PLR_OK)
        return sound;
    if (!plr_all_finite(landmark->p_W_m, 3) || !plr_all_finite(landmark->P_W_m2, 9))
        return PLR_E_NOT_FINITE;
    if (!plr_all_within(landmark->p_W_m, 3, PLR_MAX_POSITION) ||
        !plr_all_within(landmark->P_W_m2, 9, PLR_MAX_VARIANCE))
        return PLR_E_RANGE;
    if (!plr_is_place(landmark->p_W_m, landmark->P_W_m2))
        return PLR_E_ARGUMENT;
    if (!plr_process_has_started(&f->source)) /* the start turns the pose, by which it comes in */
        return PLR_E_NOT_READY;
    if (plr_slots_find(&f->belief, landmark->id) != PLR_NO_SLOT)
        return PLR_E_EXISTS;
    if (f->belief.count >= f->config.slots)
        return PLR_E_FULL;
    plr_new_landmark entering;
    if (!plr_model_of(&f->belief)->adopt(&f->belief, &f->camera, &f->motion, landmark, &entering))
        return PLR_E_RANGE;
    plr_slots_append(&f->belief, landmark->id, true, &entering);
    plr_alignment_keep_world(&f->source);
    plr_guard_seal_whole(f);
    return PLR_OK;
}

plr_status plr_filter_flush_map(plr_filter *f) {
    const plr_status sound = plr_guard_check_whole(f);
    if (sound != PLR_OK)
        return sound;
    if (!f->map.sink)
        return PLR_E_MODE;
    for (unsigned slot = f->belief.count; slot-- > 0;) { /* backwards: removing moves the last */
        plr_landmark landmark;
        if (!plr_slots_export(&f->belief, &f->camera, &f->motion, slot, &landmark) ||
            f->map.sink(f->map.context, &landmark) == 0)
            plr_slots_remove(&f->belief, slot);
    }
    plr_guard_seal_whole(f);
    return f->belief.count == 0 ? PLR_OK : PLR_E_IO;
}
