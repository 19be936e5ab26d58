// SPDX-License-Identifier: MIT
/* What a board with two cameras does beside its registers: strips become pairs, interrupts' times become time that
 * never wraps, readings wait for the loop, exposure follows the light. */
#include <string.h>
#include <unity.h>

#include "../../port/cortex_m/capture.c"
#include "../../port/cortex_m/exposure.h"
#include "../../port/cortex_m/readings.h"
#include "../../port/cortex_m/ticks.h"

enum { WIDTH = 8, HEIGHT = 6, ROWS = 2, STRIPS = HEIGHT / ROWS, PIXELS = WIDTH * HEIGHT };

static uint32_t memory[2][2][PIXELS / 4 + 1]; /* with a word behind each picture */
static uint32_t bank[CAPTURE_BANKS][ROWS * WIDTH / 2];
static capture c;
static unsigned bank_of_dma;

void setUp(void) {
    memset(&c, 0, sizeof c);
    memset(memory, 0xA5, sizeof memory);
    for (unsigned i = 0; i < 2; i++) {
        c.pairs[i].left = (uint8_t *)memory[i][0];
        c.pairs[i].right = (uint8_t *)memory[i][1];
    }
    c.width = WIDTH, c.height = HEIGHT, c.rows = ROWS;
}

static unsigned written_now(void) {
    return bank_of_dma;
}

/* Seven bits of each camera at a place of the picture, another one for each frame. */
static unsigned left_at(unsigned frame, unsigned place) {
    return (frame * 31 + place * 5) % 128;
}

static unsigned right_at(unsigned frame, unsigned place) {
    return (frame * 17 + place * 11 + 64) % 128;
}

/* The DCMI puts the earlier of two places into the lower half of a word. */
static void fill_bank(unsigned frame, unsigned strip) {
    for (unsigned i = 0; i < ROWS * WIDTH / 2; i++) {
        const unsigned place = strip * ROWS * WIDTH + 2 * i;
        const uint32_t first = left_at(frame, place) | right_at(frame, place) << 7;
        const uint32_t second = left_at(frame, place + 1) | right_at(frame, place + 1) << 7;
        bank[strip % CAPTURE_BANKS][i] = first | second << 16;
    }
}

static void send_strips(unsigned frame, unsigned first, unsigned end) {
    for (unsigned strip = first; strip < end; strip++) {
        fill_bank(frame, strip);
        bank_of_dma = (strip + 1) % CAPTURE_BANKS;
        TEST_ASSERT_EQUAL_UINT(strip % CAPTURE_BANKS, capture_bank(&c));
        capture_strip(&c, bank[capture_bank(&c)], written_now);
    }
}

static bool send_frame(unsigned frame) {
    const bool free = capture_begin(&c);
    capture_exposed(&c, 1000U * frame);
    if (free)
        send_strips(frame, 0, STRIPS);
    return free;
}

static void assert_is(const capture_pair *pair, unsigned frame) {
    TEST_ASSERT_NOT_NULL(pair);
    TEST_ASSERT_EQUAL_UINT64(1000U * frame, pair->t_ns);
    for (unsigned place = 0; place < PIXELS; place++) {
        const unsigned left = left_at(frame, place), right = right_at(frame, place);
        TEST_ASSERT_EQUAL_UINT8(left << 1 | left >> 6, pair->left[place]);
        TEST_ASSERT_EQUAL_UINT8(right << 1 | right >> 6, pair->right[place]);
    }
}

/* --- pairs --- */

static void test_strips_become_two_pictures_and_nothing_else_is_written(void) {
    TEST_ASSERT_NULL(capture_take(&c));
    TEST_ASSERT_TRUE(send_frame(3));
    assert_is(capture_take(&c), 3);
    TEST_ASSERT_EQUAL_HEX32(0xA5A5A5A5, memory[0][0][PIXELS / 4]);
    TEST_ASSERT_EQUAL_HEX32(0xA5A5A5A5, memory[0][1][PIXELS / 4]);
    TEST_ASSERT_EQUAL_HEX32(0xA5A5A5A5, memory[1][0][0]);
    TEST_ASSERT_EQUAL_HEX32(0xA5A5A5A5, memory[1][1][0]);
}

static void test_black_stays_black_and_white_white(void) {
    capture_begin(&c);
    memset(bank, 0, sizeof bank);
    for (unsigned i = 0; i < ROWS * WIDTH / 2; i++)
        bank[0][i] = 0x007F007F; /* left white, right black */
    bank_of_dma = 1;
    capture_strip(&c, bank[0], written_now);
    TEST_ASSERT_EACH_EQUAL_UINT8(255, c.pairs[0].left, ROWS * WIDTH);
    TEST_ASSERT_EACH_EQUAL_UINT8(0, c.pairs[0].right, ROWS * WIDTH);
}

static void test_what_the_loop_holds_is_not_written_while_the_next_pairs_come(void) {
    send_frame(1);
    const capture_pair *held = capture_take(&c);
    TEST_ASSERT_TRUE(send_frame(2));
    assert_is(held, 1);
    TEST_ASSERT_FALSE(send_frame(3)); /* one is held, one waits */
    assert_is(held, 1);
    assert_is(capture_take(&c), 2);
    TEST_ASSERT_TRUE(send_frame(4)); /* into the one that was held */
    assert_is(capture_take(&c), 4);
    TEST_ASSERT_NULL(capture_take(&c));
    TEST_ASSERT_EQUAL_UINT32(3, c.done);
    TEST_ASSERT_EQUAL_UINT32(1, c.busy);
    TEST_ASSERT_EQUAL_UINT32(0, c.broken);
}

static void test_a_loop_that_keeps_up_gets_each_pair_once(void) {
    for (unsigned frame = 0; frame < 20; frame++) {
        TEST_ASSERT_TRUE(send_frame(frame));
        assert_is(capture_take(&c), frame);
        TEST_ASSERT_NULL(capture_take(&c));
    }
}

static void test_a_picture_that_lacks_strips_is_left_out_and_the_next_is_whole(void) {
    capture_begin(&c);
    capture_exposed(&c, 5);
    send_strips(1, 0, STRIPS - 1);
    TEST_ASSERT_NULL(capture_take(&c));
    TEST_ASSERT_TRUE(send_frame(2));
    assert_is(capture_take(&c), 2);
    TEST_ASSERT_EQUAL_UINT32(1, c.broken);
    TEST_ASSERT_EQUAL_UINT32(1, c.done);
}

static void test_a_strip_that_was_overwritten_while_it_was_read_spoils_its_picture(void) {
    for (unsigned late = 0; late < STRIPS; late++) {
        setUp();
        capture_begin(&c);
        capture_exposed(&c, 5);
        send_strips(1, 0, late);
        bank_of_dma = late % CAPTURE_BANKS; /* the DMA is back in the bank that is read */
        capture_strip(&c, bank[late % CAPTURE_BANKS], written_now);
        send_strips(1, late + 1, STRIPS);
        TEST_ASSERT_NULL(capture_take(&c));
        TEST_ASSERT_EQUAL_UINT32(1, c.broken);
        TEST_ASSERT_TRUE(send_frame(2));
        assert_is(capture_take(&c), 2);
    }
}

static void test_a_picture_without_a_time_is_left_out(void) {
    capture_begin(&c);
    send_strips(1, 0, STRIPS);
    TEST_ASSERT_NULL(capture_take(&c));
    TEST_ASSERT_EQUAL_UINT32(1, c.broken);
}

static void test_times_and_strips_of_a_picture_that_is_left_out_touch_nothing(void) {
    send_frame(1);
    const capture_pair *held = capture_take(&c);
    send_frame(2);
    TEST_ASSERT_FALSE(capture_begin(&c));
    capture_exposed(&c, 77);
    capture_strip(&c, bank[0], written_now);
    assert_is(held, 1);
    assert_is(capture_take(&c), 2);
}

/* --- time --- */

static void test_a_timer_of_32_bits_tells_time_beyond_its_turns(void) {
    uint64_t latest = 0, expected = 0;
    for (unsigned i = 0; i < 40; i++) {
        expected += 0x30000001;
        TEST_ASSERT_EQUAL_UINT64(expected, ticks_extend(&latest, (uint32_t)expected));
    }
}

static void test_a_moment_before_the_latest_one_is_told_and_sets_no_time_back(void) {
    uint64_t latest = 0x100000010;
    TEST_ASSERT_EQUAL_UINT64(0xFFFFFFF0, ticks_extend(&latest, 0xFFFFFFF0)); /* a turn earlier */
    TEST_ASSERT_EQUAL_UINT64(0x100000010, latest);
    TEST_ASSERT_EQUAL_UINT64(0x100000020, ticks_extend(&latest, 0x20));
}

static void test_the_middle_of_an_exposure_across_the_turn_of_the_timer(void) {
    TEST_ASSERT_EQUAL_HEX32(150, ticks_middle(100, 200));
    TEST_ASSERT_EQUAL_HEX32(0xFFFFFFFC, ticks_middle(0xFFFFFFF0, 8));
    TEST_ASSERT_EQUAL_HEX32(4, ticks_middle(0xFFFFFFF8, 0x10));
}

/* --- readings --- */

static void test_readings_come_out_in_order_up_to_a_time_and_what_finds_no_room_is_counted(void) {
    static readings queue;
    reading one;
    uint64_t next = 0, out = 0;
    for (unsigned round = 0; round < 5; round++) {
        for (unsigned i = 0; i < READINGS + 2; i++) {
            const reading in = {.t_ns = 10 * next};
            next += queue.put - queue.taken < READINGS;
            readings_put(&queue, &in);
        }
        TEST_ASSERT_EQUAL_UINT32(2 * (round + 1), queue.lost);
        while (readings_take(&queue, 10 * (next - 3), &one))
            TEST_ASSERT_EQUAL_UINT64(10 * out++, one.t_ns);
        TEST_ASSERT_EQUAL_UINT64(next - 2, out);
        while (readings_take(&queue, UINT64_MAX, &one))
            TEST_ASSERT_EQUAL_UINT64(10 * out++, one.t_ns);
        TEST_ASSERT_EQUAL_UINT64(next, out);
    }
}

/* --- exposure --- */

/* The mean grey level of a scene that a row of exposure makes brighter by so much. */
static uint32_t mean_of(double light, uint16_t rows) {
    const double mean = light * rows;
    return mean < 255 ? (uint32_t)mean : 255;
}

static void test_exposure_finds_its_grey_level_from_anywhere_and_stays_there(void) {
    const double lights[] = {0.35, 1, 10, 60};
    for (unsigned i = 0; i < 4; i++)
        for (uint16_t rows = 1; rows <= 315; rows = (uint16_t)(rows * 3 + 1)) {
            uint16_t now = rows;
            for (unsigned k = 0; k < 12; k++)
                now = exposure_next(now, mean_of(lights[i], now), 315);
            const uint32_t mean = mean_of(lights[i], now);
            TEST_ASSERT_TRUE(mean >= EXPOSURE_DARKEST && mean <= EXPOSURE_BRIGHTEST);
            TEST_ASSERT_EQUAL_UINT16(now, exposure_next(now, mean, 315));
        }
}

static void test_exposure_stays_within_its_bounds(void) {
    TEST_ASSERT_EQUAL_UINT16(315, exposure_next(300, 0, 315));
    TEST_ASSERT_EQUAL_UINT16(1, exposure_next(1, 255, 315));
    TEST_ASSERT_EQUAL_UINT16(2, exposure_next(1, 0, 315));
    TEST_ASSERT_EQUAL_UINT16(100, exposure_next(200, 255, 315));
}
