// SPDX-License-Identifier: MIT
/* The fuzz harness without libFuzzer: over what libFuzzer found before (tests/fuzz/corpus), over a
 * stream and payloads of every kind, and over seeded changes to all of them. The harness aborts
 * where something does not hold. */
#include <string.h>
#include <unity.h>

#include "fuzz/fuzz_reader.c"
#include "fuzz/inputs.h"
#include "support/wire_frames.h"
#include "support/wire_samples.h"

void setUp(void) {
    dice = rng_seeded(2024);
}

/* One of: a bit flipped, a byte replaced, a byte put in, a byte taken out, the end cut off. */
static void change(input *in) {
    if (in->size == 0)
        return;
    size_t at = rng_below(&dice, (unsigned)in->size);
    uint8_t *byte = &in->bytes[at];
    switch (rng_below(&dice, 5)) {
    case 0:
        *byte = (uint8_t)(*byte ^ 1U << rng_below(&dice, 8));
        break;
    case 1:
        *byte = (uint8_t)rng_bits(&dice);
        break;
    case 2:
        if (in->size == INPUT_SIZE)
            break;
        memmove(byte + 1, byte, in->size - at);
        in->size++;
        break;
    case 3:
        memmove(byte, byte + 1, in->size - at - 1);
        in->size--;
        break;
    default:
        in->size = at;
    }
}

static void hold(const input *seed) {
    run_with_changes(seed, 400, 3, change);
}

/* A sample small enough for an input. */
static plr_message small_sample(unsigned kind, unsigned variant) {
    plr_message m = wire_sample((plr_kind)kind, variant);
    if (m.kind == PLR_KIND_STEREO && m.as.stereo.count > 40)
        m.as.stereo.count = 40;
    return m;
}

static void test_payloads_of_every_kind_hold_under_any_change(void) {
    static input seed;
    for (unsigned kind = PLR_KIND_HEADER; kind <= PLR_WIRE_KINDS; kind++) {
        for (unsigned variant = 0; variant < WIRE_SAMPLE_VARIANTS; variant++) {
            plr_message m = small_sample(kind, variant);
            seed.bytes[0] = AS_PAYLOAD | ROOM_BITS;
            seed.bytes[1] = (uint8_t)kind;
            seed.size = 2 + wire_payload(&m, seed.bytes + 2, INPUT_SIZE - 2);
            hold(&seed);
        }
    }
}

static void test_streams_of_every_kind_hold_under_any_change(void) {
    static input seed;
    for (unsigned variant = 0; variant < WIRE_SAMPLE_VARIANTS; variant++) {
        seed.bytes[0] = ROOM_BITS;
        seed.bytes[1] = 17;
        byte_sink sink = byte_sink_over(seed.bytes + 2, INPUT_SIZE - 2);
        plr_writer w;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_writer_init(&w, byte_sink_write, &sink));
        for (unsigned kind = PLR_KIND_HEADER; kind <= PLR_WIRE_KINDS; kind++) {
            plr_message m = small_sample(kind, variant);
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_writer_put(&w, &m));
        }
        seed.size = 2 + sink.length;
        hold(&seed);
    }
}

static void test_what_libfuzzer_found_holds_under_any_change(void) {
    TEST_ASSERT_GREATER_THAN_UINT(10, run_corpus(PELORUS_SOURCE_DIR "/tests/fuzz/corpus", hold));
}
