// SPDX-License-Identifier: MIT
#include "capture.h"

#include <stddef.h>

#include "barrier.h"

static void give_up(capture *c) {
    c->filling->state = CAPTURE_FREE;
    c->filling = NULL;
    ++c->broken;
}

bool capture_begin(capture *c) {
    if (c->filling != NULL) {
        give_up(c);
    }
    for (unsigned i = 0; i < 2; ++i) {
        if (c->pairs[i].state == CAPTURE_FREE) {
            c->filling = &c->pairs[i];
            c->filling->state = CAPTURE_FILLING;
            compiler_barrier(); /* its pixels are written from now on */
            c->strip = 0;
            c->stamped = c->late = false;
            return true;
        }
    }
    ++c->busy;
    return false;
}

void capture_exposed(capture *c, uint64_t t_ns) {
    if (c->filling != NULL) {
        c->filling->t_ns = t_ns;
        c->stamped = true;
    }
}

/* The two grey levels that stand in a word of two places, as 8 bits: the upper bit again below the lowest, so
 * that white stays white. */
static uint32_t two_of(uint32_t sevens) {
    const uint32_t eights = sevens << 1 | (sevens >> 6 & 0x00010001U);
    return (eights | eights >> 8) & 0xFFFFU;
}

static void split(const volatile uint32_t *strip, uint32_t words, uint32_t *left, uint32_t *right) {
    const uint32_t sevens = 0x007F007FU;
    for (uint32_t i = 0; i + 1 < words; i += 2) {
        const uint32_t a = strip[i], b = strip[i + 1];
        *left++ = two_of(a & sevens) | two_of(b & sevens) << 16;
        *right++ = two_of(a >> 7 & sevens) | two_of(b >> 7 & sevens) << 16;
    }
}

void capture_strip(capture *c, const volatile uint32_t *strip, unsigned (*written_now)(void)) {
    const unsigned bank = capture_bank(c);
    if (c->filling == NULL) {
        return;
    }
    const uint32_t words = capture_strip_words(c), at = c->strip * words / 2;
    split(strip, words, (uint32_t *)(void *)c->filling->left + at,
          (uint32_t *)(void *)c->filling->right + at);
    c->late = c->late || written_now() == bank;
    if (++c->strip < c->height / c->rows) {
        return;
    }
    if (c->late || !c->stamped) {
        give_up(c);
        return;
    }
    compiler_barrier();
    c->filling->state = CAPTURE_FULL; /* the last write: from now on it is the loop's */
    c->filling = NULL;
    ++c->done;
}

const capture_pair *capture_take(capture *c) {
    capture_pair *full = NULL;
    compiler_barrier(); /* the caller has read the one that it gives back */
    for (unsigned i = 0; i < 2; ++i) {
        if (c->pairs[i].state == CAPTURE_HELD) {
            c->pairs[i].state = CAPTURE_FREE;
        } else if (c->pairs[i].state == CAPTURE_FULL &&
                   (full == NULL || c->pairs[i].t_ns < full->t_ns)) {
            full = &c->pairs[i];
        }
    }
    if (full != NULL) {
        full->state = CAPTURE_HELD;
    }
    compiler_barrier(); /* its pixels are read from now on */
    return full;
}
