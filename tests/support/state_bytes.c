// SPDX-License-Identifier: MIT
#include "support/state_bytes.h"

#include <string.h>
#include <unity.h>

#include "math/packed.h"
#include "state/covariance.h"

static bool call_fails(state_bytes *state, uint32_t n) {
    if (n > state->most_at_once)
        state->most_at_once = n;
    return ++state->calls == state->fails_at;
}

int state_bytes_take(void *context, const uint8_t *bytes, uint32_t n) {
    state_bytes *state = context;
    if (call_fails(state, n) || n > STATE_BYTES_MAX - state->length)
        return -1;
    memcpy(state->bytes + state->length, bytes, n);
    state->length += n;
    return 0;
}

int state_bytes_give(void *context, uint32_t offset, uint8_t *bytes, uint32_t n) {
    state_bytes *state = context;
    if (call_fails(state, n) || offset > state->length || n > state->length - offset)
        return -1;
    memcpy(bytes, state->bytes + offset, n);
    if (state->calls == state->flips_at)
        bytes[0] ^= 1;
    state->out_of_order |= offset != state->next && offset != 0;
    state->next = offset + n;
    return 0;
}

void state_bytes_save(state_bytes *state, const plr_filter *f) {
    state->length = state->next = 0;
    state->fails_at = state->flips_at = state->calls = state->most_at_once = 0;
    state->out_of_order = false;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_save(f, state_bytes_take, state));
}

plr_status state_bytes_restore(state_bytes *state, plr_filter *f) {
    state->calls = 0;
    state->next = 0;
    return plr_filter_restore(f, state->length, state_bytes_give, state);
}

bool state_bytes_same(const state_bytes *a, const state_bytes *b) {
    return a->length == b->length && memcmp(a->bytes, b->bytes, a->length) == 0;
}

bool state_bytes_same_filter(const plr_filter *a, const plr_filter *b) {
    static plr_filter copy;
    const unsigned n = plr_covariance_dim(&a->belief);
    const size_t P = plr_packed_row(n);
    if (a->belief.count != b->belief.count)
        return false;
    memcpy(&copy, a, sizeof copy);
    memcpy(&copy.work, &b->work, sizeof copy.work);
    memcpy(&copy.evidence, &b->evidence, sizeof copy.evidence); /* of one frame */
    memcpy(&copy.guard, &b->guard, sizeof copy.guard);
    memcpy(copy.belief.slots + a->belief.count, b->belief.slots + a->belief.count,
           (PLR_MAX_LANDMARKS - a->belief.count) * sizeof *copy.belief.slots);
    memcpy(copy.belief.P + P, b->belief.P + P, (PLR_PACKED_SIZE - P) * sizeof *copy.belief.P);
    for (unsigned k = 0; k < PLR_CALIBRATIONS; k++)
        memcpy(copy.belief.S[k] + n, b->belief.S[k] + n,
               (PLR_MAX_LD - n) * sizeof *copy.belief.S[k]);
    return memcmp(&copy, b, sizeof copy) == 0;
}
