// SPDX-License-Identifier: MIT
#include "filter/frozen.h"

#include <string.h>

#include "math/small.h"
#include "state/slots.h"

enum {
    FEW = 3,       /* points */
    SAME_SHARE = 2 /* a picture is repeated if at least one match in two has the same pixels */
};

/* The picture should have changed if the motion by twists since then exceeds its own noise by this,
 * as a sum of squares in units of sigma. */
#define MOVED_ABOVE PLR_R(36)

/* A hash of an observation's four pixel coordinates. */
static uint32_t hash_of_pixels(const plr_observation *o) {
    const float pixels[4] = {o->uL_px, o->vL_px, o->uR_px, o->vR_px};
    uint32_t print = 2166136261U;
    for (unsigned i = 0; i < 4; i++) {
        uint32_t bits;
        memcpy(&bits, &pixels[i], sizeof bits);
        print = (print ^ bits) * 16777619U;
        print ^= print >> 15;
    }
    return print;
}

/* The motion by twists since the picture was new, and its variance. */
static void motion_since(const plr_filter *f, plr_real way[PLR_POSE_DIM],
                         plr_real variance[PLR_POSE_DIM]) {
    const plr_consistency *c = &f->consistency;
    const plr_motion *m = &f->motion;
    plr_real turn[3];
    plr_turn_of(turn, m->E);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        way[k] = c->frozen_motion[k] + (k < 3 ? m->p[k] : turn[k - 3]);
        variance[k] = c->frozen_variance[k] + m->Q[(PLR_POSE_DIM + 1) * k];
    }
}

void plr_frozen_note_motion(plr_filter *f) {
    motion_since(f, f->consistency.frozen_motion, f->consistency.frozen_variance);
}

/* True if the motion by twists since the picture was new is larger than its noise. */
static bool has_moved(const plr_filter *f) {
    plr_real way[PLR_POSE_DIM], variance[PLR_POSE_DIM], sum = 0;
    motion_since(f, way, variance);
    for (unsigned k = 0; k < PLR_POSE_DIM; k++) {
        if (variance[k] > 0)
            sum += way[k] * way[k] / variance[k];
        else if (way[k] * way[k] > PLR_R(1e-8))
            sum += PLR_R(2) * MOVED_ABOVE;
    }
    return sum > MOVED_ABOVE;
}

bool plr_frozen_is_seen(plr_filter *f, const plr_frame *frame, unsigned n) {
    plr_consistency *c = &f->consistency;
    unsigned matched = 0, same = 0;
    for (unsigned k = 0; k < n; k++) {
        if (f->work.slot_of[k] == PLR_NO_SLOT)
            continue;
        plr_slot *slot = &f->slots[f->work.slot_of[k]];
        const uint32_t print = hash_of_pixels(&frame->observations[f->work.order[k]]);
        matched++;
        same += slot->pixel_hash == print;
        slot->pixel_hash = print;
    }
    c->frozen = 0;
    if (matched < FEW || SAME_SHARE * same < matched) {
        memset(c->frozen_motion, 0, sizeof c->frozen_motion);
        memset(c->frozen_variance, 0, sizeof c->frozen_variance);
        return false;
    }
    if (has_moved(f)) {
        c->frozen = 1;
        return true;
    }
    plr_frozen_note_motion(f); /* this frame is used, and ends what is pending in f->motion */
    return false;
}
