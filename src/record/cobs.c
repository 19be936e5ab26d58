// SPDX-License-Identifier: MIT
#include "record/cobs.h"

#include "pelorus/assertions.h"

enum { DELIMITER = 0, FULL_BLOCK = 0xFF };

plr_cobs_step plr_cobs_decode(plr_cobs_decoder *d, uint8_t stuffed, uint8_t *data) {
    PLR_ASSERT(d->code != 0 || d->left == 0);
    if (stuffed == DELIMITER) {
        plr_cobs_step step = d->code == 0 ? PLR_COBS_EMPTY
                             : d->left    ? PLR_COBS_BROKEN
                                          : PLR_COBS_END;
        d->code = d->left = 0;
        return step;
    }
    if (d->left) {
        d->left--;
        *data = stuffed;
        return PLR_COBS_BYTE;
    }
    /* A code byte. Only now is it known that the block before it was not the last. */
    bool zero_between = d->code != 0 && d->code != FULL_BLOCK;
    d->code = stuffed;
    d->left = (uint8_t)(stuffed - 1);
    if (!zero_between)
        return PLR_COBS_NOTHING;
    *data = 0;
    return PLR_COBS_BYTE;
}

bool plr_cobs_in_frame(const plr_cobs_decoder *d) {
    return d->code != 0;
}

void plr_cobs_begin(plr_cobs_encoder *e) {
    e->fill = 1;
}

unsigned plr_cobs_encode(plr_cobs_encoder *e, uint8_t data) {
    PLR_ASSERT(e->fill < FULL_BLOCK); /* a full one was sent, and is not open any more */
    if (e->fill == 0)                 /* a full block went before; it is not the last after all */
        e->fill = 1;
    if (data != 0) {
        e->block[e->fill++] = data;
        if (e->fill < FULL_BLOCK)
            return 0;
    }
    unsigned n = e->fill;
    e->block[0] = e->fill;
    e->fill = data == 0 ? 1 : 0;
    return n;
}

unsigned plr_cobs_end(plr_cobs_encoder *e) {
    PLR_ASSERT(e->fill < FULL_BLOCK);
    unsigned n = e->fill;
    e->block[0] = e->fill;
    e->block[n] = DELIMITER;
    return n + 1;
}
