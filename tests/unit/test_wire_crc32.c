// SPDX-License-Identifier: MIT
/* CRC-32 as in zlib. */
#include <unity.h>

#include "pelorus/wire.h"

static const uint8_t digits[] = {'1', '2', '3', '4', '5', '6', '7', '8', '9'};

static void test_nine_digits_give_the_published_check_value(void) {
    TEST_ASSERT_EQUAL_HEX32(0xCBF43926, plr_crc32(0, digits, sizeof digits));
}

static void test_no_bytes_leave_it_as_it_is(void) {
    TEST_ASSERT_EQUAL_HEX32(0, plr_crc32(0, NULL, 0));
    TEST_ASSERT_EQUAL_HEX32(0xCBF43926, plr_crc32(0xCBF43926, NULL, 0));
}

static void test_parts_give_the_same_as_the_whole(void) {
    for (size_t cut = 0; cut <= sizeof digits; cut++) {
        uint32_t crc = plr_crc32(0, digits, cut);
        crc = plr_crc32(crc, digits + cut, sizeof digits - cut);
        TEST_ASSERT_EQUAL_HEX32(0xCBF43926, crc);
    }
}

/* One byte each: the remainder of the byte by the polynomial, worked out bit by bit. */
static void test_every_byte_goes_by_the_polynomial(void) {
    for (unsigned byte = 0; byte < 256; byte++) {
        uint32_t expected = 0xFFFFFFFF ^ byte;
        for (int bit = 0; bit < 8; bit++)
            expected = expected & 1 ? expected >> 1 ^ 0xEDB88320 : expected >> 1;
        uint8_t one = (uint8_t)byte;
        TEST_ASSERT_EQUAL_HEX32(~expected, plr_crc32(0, &one, 1));
    }
}

static void test_any_two_flipped_bits_change_it(void) {
    enum { BITS = 8 * sizeof digits };
    for (unsigned first = 0; first < BITS; first++) {
        for (unsigned second = first; second < BITS; second++) {
            uint8_t copy[sizeof digits];
            for (unsigned i = 0; i < sizeof digits; i++)
                copy[i] = digits[i];
            copy[first / 8] = (uint8_t)(copy[first / 8] ^ 1U << first % 8);
            if (second != first)
                copy[second / 8] = (uint8_t)(copy[second / 8] ^ 1U << second % 8);
            TEST_ASSERT_NOT_EQUAL_HEX32(0xCBF43926, plr_crc32(0, copy, sizeof copy));
        }
    }
}
