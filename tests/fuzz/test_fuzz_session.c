// SPDX-License-Identifier: MIT
/* The fuzz harness of the whole loop without libFuzzer: over tests/fuzz/corpus_session, and over
 * seeded changes to all of it. The harness aborts where something does not hold. */
#include <string.h>
#include <unity.h>

#include "fuzz/fuzz_session.c"
#include "fuzz/inputs.h"

#define CORPUS PELORUS_SOURCE_DIR "/tests/fuzz/corpus_session"

/* A bit, a byte, or eight bytes that make some double or other; sizes and order stay. */
static void change(input *in) {
    const size_t at = rng_below(&dice, (unsigned)in->size);
    const size_t room = in->size - at;
    double number = rng_normal(&dice) * (rng_below(&dice, 2) ? 1e3 : 1e30);
    switch (rng_below(&dice, 4)) {
    case 0:
        in->bytes[at] = (uint8_t)(in->bytes[at] ^ 1U << rng_below(&dice, 8));
        break;
    case 1:
        in->bytes[at] = (uint8_t)rng_bits(&dice);
        break;
    case 2:
        number = (double)NAN;
        /* fall through */
    default:
        memcpy(in->bytes + at, &number, room < sizeof number ? room : sizeof number);
    }
}

static void hold(const input *seed) {
    TEST_ASSERT_TRUE(seed->size >= 2);
    run_with_changes(seed, 100, 8, change);
}

static void test_the_corpus_holds_under_any_change(void) {
    TEST_ASSERT_GREATER_THAN_UINT(9, run_corpus(CORPUS, hold));
}

/* Were the seeds refused at their first frame, the test above would test nothing. */
static void test_the_first_seed_reaches_the_filter(void) {
    static input seed;
    static byte_stream in;
    static machine m;
    static plr_session session;
    plr_session_options options;
    const plr_port port = {.context = &m, .read = read_bytes};
    read_input(CORPUS, "seed-slam", &seed);
    in.length = 0;
    append_records(&in, seed.bytes + 2, seed.size - 2);
    m.bytes = in.bytes;
    m.left = in.length;
    m.piece = 256;
    plr_session_options_default(&options);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(&session, &port, &options));
    while (plr_session_step(&session) != PLR_STEP_CLOSED)
        continue;
    TEST_ASSERT_EQUAL_UINT32(7, session.totals.stereos);
    TEST_ASSERT_TRUE(session.last.used > 2);
}
