// SPDX-License-Identifier: MIT
/* Consistent Overhead Byte Stuffing. */
#include "record/cobs.h"

#include <string.h>
#include <unity.h>

#include "support/random.h"

enum { MOST_DATA = 1100, MOST_STUFFED = MOST_DATA + MOST_DATA / 254 + 2 };

/* Stuffs n bytes; returns the length with the delimiter. */
static size_t stuff(const uint8_t *data, size_t n, uint8_t *stuffed) {
    plr_cobs_encoder e;
    size_t length = 0;
    plr_cobs_begin(&e);
    for (size_t i = 0; i < n; i++) {
        unsigned ready = plr_cobs_encode(&e, data[i]);
        TEST_ASSERT_LESS_OR_EQUAL_UINT(255, ready);
        memcpy(stuffed + length, e.block, ready);
        length += ready;
    }
    unsigned ready = plr_cobs_end(&e);
    memcpy(stuffed + length, e.block, ready);
    return length + ready;
}

/* Takes stuffed bytes up to the first delimiter; *n is the length of the data. */
static plr_cobs_step unstuff(const uint8_t *stuffed, uint8_t *data, size_t *n) {
    plr_cobs_decoder d = {0};
    *n = 0;
    for (size_t i = 0;; i++) {
        plr_cobs_step step = plr_cobs_decode(&d, stuffed[i], &data[*n]);
        if (step == PLR_COBS_BYTE)
            ++*n;
        else if (step != PLR_COBS_NOTHING)
            return step;
    }
}

static void assert_stuffs_to(const uint8_t *data, size_t n, const uint8_t *expected,
                             size_t length) {
    uint8_t stuffed[MOST_STUFFED], back[MOST_STUFFED];
    TEST_ASSERT_EQUAL_size_t(length, stuff(data, n, stuffed));
    TEST_ASSERT_EQUAL_MEMORY(expected, stuffed, length);
    size_t n_back;
    TEST_ASSERT_EQUAL_INT(PLR_COBS_END, unstuff(stuffed, back, &n_back));
    TEST_ASSERT_EQUAL_size_t(n, n_back);
    if (n > 0)
        TEST_ASSERT_EQUAL_MEMORY(data, back, n);
}

static void test_short_data_stuff_as_the_paper_says(void) {
    static const uint8_t none[] = {1, 0};
    assert_stuffs_to(none, 0, none, 2);
    static const uint8_t zero[] = {0}, zero_stuffed[] = {1, 1, 0};
    assert_stuffs_to(zero, 1, zero_stuffed, 3);
    static const uint8_t zeros[] = {0, 0}, zeros_stuffed[] = {1, 1, 1, 0};
    assert_stuffs_to(zeros, 2, zeros_stuffed, 4);
    static const uint8_t mixed[] = {0x11, 0x22, 0x00, 0x33},
                         mixed_stuffed[] = {3, 0x11, 0x22, 2, 0x33, 0};
    assert_stuffs_to(mixed, 4, mixed_stuffed, 6);
    static const uint8_t tail[] = {0x11, 0, 0, 0}, tail_stuffed[] = {2, 0x11, 1, 1, 1, 0};
    assert_stuffs_to(tail, 4, tail_stuffed, 6);
}

static void test_a_full_block_at_the_end_has_no_empty_one_behind_it(void) {
    uint8_t data[255], expected[260];
    memset(data, 7, sizeof data);
    memset(expected, 7, sizeof expected);
    expected[0] = 0xFF;
    expected[255] = 0;
    assert_stuffs_to(data, 254, expected, 256);
    expected[255] = 2;
    expected[256] = 7;
    expected[257] = 0;
    assert_stuffs_to(data, 255, expected, 258);
    data[254] = 0;
    expected[255] = expected[256] = 1;
    assert_stuffs_to(data, 255, expected, 258);
}

static void test_an_empty_block_behind_a_full_one_is_taken_too(void) {
    uint8_t stuffed[257], data[300];
    memset(stuffed, 7, sizeof stuffed);
    stuffed[0] = 0xFF;
    stuffed[255] = 1;
    stuffed[256] = 0;
    size_t n;
    TEST_ASSERT_EQUAL_INT(PLR_COBS_END, unstuff(stuffed, data, &n));
    TEST_ASSERT_EQUAL_size_t(254, n);
}

static void test_a_delimiter_alone_is_an_empty_frame(void) {
    const uint8_t stuffed[] = {0};
    uint8_t data[1];
    size_t n;
    TEST_ASSERT_EQUAL_INT(PLR_COBS_EMPTY, unstuff(stuffed, data, &n));
}

static void test_a_delimiter_within_a_block_is_broken_and_the_next_frame_is_whole(void) {
    for (unsigned code = 2; code < 256; code++) {
        plr_cobs_decoder d = {0};
        uint8_t data;
        TEST_ASSERT_EQUAL_INT(PLR_COBS_NOTHING, plr_cobs_decode(&d, (uint8_t)code, &data));
        for (unsigned i = 0; i + 2 < code; i++)
            TEST_ASSERT_EQUAL_INT(PLR_COBS_BYTE, plr_cobs_decode(&d, 9, &data));
        TEST_ASSERT_TRUE(plr_cobs_in_frame(&d));
        TEST_ASSERT_EQUAL_INT(PLR_COBS_BROKEN, plr_cobs_decode(&d, 0, &data));
        TEST_ASSERT_FALSE(plr_cobs_in_frame(&d));
        TEST_ASSERT_EQUAL_INT(PLR_COBS_NOTHING, plr_cobs_decode(&d, 2, &data));
        TEST_ASSERT_EQUAL_INT(PLR_COBS_BYTE, plr_cobs_decode(&d, 5, &data));
        TEST_ASSERT_EQUAL_INT(PLR_COBS_END, plr_cobs_decode(&d, 0, &data));
    }
}

/* Data of every length, zeros rare or common: no zero within, bounded overhead, and back again. */
static void test_data_of_every_length_come_back(void) {
    static uint8_t data[MOST_DATA], stuffed[MOST_STUFFED], back[MOST_STUFFED];
    rng r = rng_seeded(11);
    for (size_t n = 0; n <= MOST_DATA; n++) {
        unsigned one_in = n % 3 == 0 ? 3 : n % 3 == 1 ? 200 : 100000;
        for (size_t i = 0; i < n; i++)
            data[i] = rng_below(&r, one_in) == 0 ? 0 : (uint8_t)(1 + rng_below(&r, 255));
        size_t length = stuff(data, n, stuffed);
        TEST_ASSERT_LESS_OR_EQUAL_size_t(n + n / 254 + 2, length);
        TEST_ASSERT_NULL(memchr(stuffed, 0, length - 1));
        size_t n_back;
        TEST_ASSERT_EQUAL_INT(PLR_COBS_END, unstuff(stuffed, back, &n_back));
        TEST_ASSERT_EQUAL_size_t(n, n_back);
        TEST_ASSERT_EQUAL_INT(0, memcmp(data, back, n));
    }
}
