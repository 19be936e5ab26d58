// SPDX-License-Identifier: MIT
/* Sentences for statuses and reasons, version and fingerprint. */
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "pelorus/config.h"
#include "pelorus/filter.h"
#include "pelorus/wire.h"

enum { LAST_STATUS = PLR_E_SIZE, REASONS = 29, FREE = 17 };

/* Texts are there, say something, and each says something else. */
static void demand_distinct(const char *const *texts, unsigned count) {
    for (unsigned i = 0; i < count; i++) {
        TEST_ASSERT_NOT_NULL(texts[i]);
        TEST_ASSERT_GREATER_THAN_UINT(3, strlen(texts[i]));
        for (unsigned j = 0; j < i; j++)
            TEST_ASSERT_TRUE_MESSAGE(strcmp(texts[i], texts[j]) != 0, texts[i]);
    }
}

static void test_every_status_has_a_sentence_of_its_own(void) {
    const char *texts[2 - LAST_STATUS];
    for (int status = 1; status >= LAST_STATUS; status--)
        texts[1 - status] = plr_status_text((plr_status)status); /* 1: of no version */
    demand_distinct(texts, 2 - LAST_STATUS);
    TEST_ASSERT_EQUAL_STRING(texts[0], plr_status_text((plr_status)(LAST_STATUS - 1)));
}

static void test_every_reason_has_a_phrase_of_its_own(void) {
    const char *texts[REASONS + 1];
    for (unsigned bit = 0; bit <= REASONS; bit++)
        texts[bit] = plr_reason_text((plr_reason)(1U << bit)); /* the last: of no version */
    TEST_ASSERT_EQUAL_STRING(texts[REASONS], texts[FREE]);
    texts[FREE] = "the free one";
    demand_distinct(texts, REASONS + 1);
    TEST_ASSERT_EQUAL_INT(1 << (REASONS - 1), PLR_REASON_CALIBRATION_OFF);
    TEST_ASSERT_EQUAL_STRING(texts[REASONS],
                             plr_reason_text(PLR_REASON_BUDGET | PLR_REASON_NIS_HIGH));
}

static void test_every_health_has_a_phrase_of_its_own(void) {
    const char *texts[PLR_HEALTH_DIVERGED + 2];
    for (unsigned health = 0; health < PLR_HEALTH_DIVERGED + 2; health++)
        texts[health] = plr_health_text((plr_health)health);
    demand_distinct(texts, PLR_HEALTH_DIVERGED + 2);
}

static void test_every_fault_of_an_imu_has_a_phrase_of_its_own(void) {
    const char *texts[PLR_IMU_FAULTS + 1];
    for (unsigned fault = 0; fault <= PLR_IMU_FAULTS; fault++)
        texts[fault] = plr_imu_fault_text((plr_imu_fault)fault); /* the last: of no version */
    demand_distinct(texts, PLR_IMU_FAULTS + 1);
    for (unsigned fault = 0; fault < PLR_IMU_FAULTS; fault++)
        TEST_ASSERT_LESS_THAN_UINT(PLR_WIRE_MAX_TEXT - 10, strlen(texts[fault]));
}

static void test_version_is_the_number_of_the_header_as_text(void) {
    char expected[32];
    snprintf(expected, sizeof expected, "%d.%d.%d", PLR_VERSION_NUMBER >> 16,
             PLR_VERSION_NUMBER >> 8 & 0xFF, PLR_VERSION_NUMBER & 0xFF);
    TEST_ASSERT_EQUAL_STRING(expected, plr_version());
}

/* FNV-1a of what bits depend on, little-endian. */
static uint32_t fingerprint(uint32_t real_bits, uint32_t landmarks, uint32_t observations,
                            uint32_t block) {
    const uint32_t parts[7] = {PLR_VERSION_NUMBER,
                               PLR_ARITHMETIC,
                               real_bits,
                               landmarks,
                               observations,
                               block,
                               2 * PLR_SUPERVISE + PLR_KNOWN_MAP};
    uint32_t hash = 2166136261U;
    for (unsigned i = 0; i < 28; i++)
        hash = (hash ^ (parts[i / 4] >> (8 * (i % 4)) & 0xFF)) * 16777619U;
    return hash;
}

static void test_fingerprint_tells_builds_apart(void) {
    const uint32_t own = plr_build_fingerprint();
    TEST_ASSERT_EQUAL_HEX32(
        fingerprint(PLR_REAL, PLR_MAX_LANDMARKS, PLR_MAX_OBSERVATIONS, PLR_BLOCK_OBSERVATIONS),
        own);
    TEST_ASSERT_TRUE(own != 0);
    TEST_ASSERT_TRUE(own != fingerprint(96 - PLR_REAL, PLR_MAX_LANDMARKS, PLR_MAX_OBSERVATIONS,
                                        PLR_BLOCK_OBSERVATIONS));
    TEST_ASSERT_TRUE(own != fingerprint(PLR_REAL, PLR_MAX_LANDMARKS + 1, PLR_MAX_OBSERVATIONS,
                                        PLR_BLOCK_OBSERVATIONS));
}
