// SPDX-License-Identifier: MIT
/* A program that was compiled for fewer landmarks than its library reserved less than the library
 * wrote: 14 KB behind the filter were overwritten, and every call returned PLR_OK. */
#undef PLR_MAX_LANDMARKS
#define PLR_MAX_LANDMARKS 16 /* and the library is linked with more */

#include <string.h>
#include <unity.h>

#include "pelorus/filter.h"
#include "pelorus/session.h"

enum { BEHIND = 65536 };

static struct {
    plr_filter filter;
    unsigned char behind[BEHIND];
} reserved, untouched;

static struct {
    plr_session session;
    unsigned char behind[BEHIND];
} large, untouched_large;

static const plr_calibration camera = {.fx_px = 500,
                                       .fy_px = 500,
                                       .cx_px = 320,
                                       .cy_px = 240,
                                       .baseline_m = 0.2,
                                       .T_CB.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
static plr_config config;

void setUp(void) {
    memset(&reserved, 0, sizeof reserved);
    memset(&large, 0, sizeof large);
    plr_config_default(&config);
    config.slots = 4;
}

static void test_a_filter_of_another_size_is_refused_and_nothing_is_written(void) {
    TEST_ASSERT_EQUAL_INT(PLR_E_SIZE, plr_filter_init(&reserved.filter, &camera, &config, NULL));
    TEST_ASSERT_EQUAL_MEMORY(&untouched, &reserved, sizeof reserved);
    const plr_frame frame = {.t_ns = 1, .budget = PLR_NO_BUDGET};
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_update(&reserved.filter, &frame, NULL));
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_reset(&reserved.filter));
    TEST_ASSERT_EQUAL_MEMORY(&untouched, &reserved, sizeof reserved);
}

static int no_bytes(void *context, uint8_t *bytes, size_t n) {
    (void)context;
    (void)bytes;
    (void)n;
    return 0;
}

static void test_a_session_of_another_size_is_refused_and_nothing_is_written(void) {
    const plr_port port = {.read = no_bytes};
    plr_session_options options;
    plr_session_options_default(&options);
    TEST_ASSERT_EQUAL_INT(PLR_E_SIZE, plr_session_init(&large.session, &port, &options));
    TEST_ASSERT_EQUAL_MEMORY(&untouched_large, &large, sizeof large);
}

/* What a caller says is compared number by number: two mistakes could make up for one another. */
static void test_each_number_must_agree(void) {
    const plr_sizes mine = plr_sizes_here(sizeof(plr_filter));
    TEST_ASSERT_TRUE(plr_sizes_agree(&mine, &mine));
    for (unsigned i = 0; i < sizeof mine / sizeof(uint32_t); i++) {
        plr_sizes other = mine;
        *((uint32_t *)&other + i) += 1;
        TEST_ASSERT_FALSE(plr_sizes_agree(&mine, &other));
        TEST_ASSERT_FALSE(plr_sizes_agree(&other, &mine));
    }
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT,
                          plr_filter_init_sized(&reserved.filter, &camera, &config, NULL, NULL));
}
