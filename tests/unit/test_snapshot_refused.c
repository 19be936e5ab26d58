// SPDX-License-Identifier: MIT
/* Bytes that are no state of this filter are refused, and a refusal changes nothing. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/reseal.h"
#include "support/specimens.h"
#include "support/state_bytes.h"
#include "support/state_places.h"

enum { LANDMARKS = 3, REAL = sizeof(plr_real) };

static plr_filter filter, other, untouched;
static state_bytes state;

void setUp(void) {
    rng chance = rng_seeded(9);
    specimen_filter(&filter, &chance, PLR_MODEL_BODY, true, LANDMARKS);
    filter.config.slots = LANDMARKS + 1;
    reseal(&filter);
    memcpy(&other, &filter, sizeof other);
    state_bytes_save(&state, &filter);
}

static void refuses(plr_status expected) {
    memcpy(&untouched, &other, sizeof untouched);
    TEST_ASSERT_EQUAL_INT(expected, state_bytes_restore(&state, &other));
    TEST_ASSERT_EQUAL_MEMORY(&untouched, &other, sizeof other);
}

/* Of P, behind the landmarks. */
static uint32_t place_of_P(void) {
    return state_place_of_landmark(LANDMARKS, "x");
}

static void put_real(uint32_t at, double value) {
    const plr_real real = (plr_real)value;
    memcpy(state.bytes + at, &real, sizeof real); /* the tests run on little-endian machines */
}

/* ---------------------------------------------------------------- foreign */

static void test_another_build_or_version_is_foreign(void) {
    for (unsigned at = 0; at < state_place("origin", "settings"); at++) {
        state.bytes[at] ^= 0x40;
        refuses(PLR_E_FOREIGN);
        state.bytes[at] ^= 0x40;
    }
    TEST_ASSERT_EQUAL_INT(PLR_OK, state_bytes_restore(&state, &other));
}

static void test_each_setting_that_differs_makes_it_foreign(void) {
    for (unsigned i = 0; i < plr_setting_count(); i++) {
        const plr_setting *setting = plr_setting_at(i);
        const double here = plr_config_get(&other.config, setting);
        const double end = here > setting->minimum ? setting->minimum : setting->maximum;
        const double another = setting->kind == PLR_SETTING_COUNT ? here + 1 : end;
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_config_set(&other.config, setting, another));
        other.belief.model = other.config.model;
        reseal(&other);
        refuses(PLR_E_FOREIGN);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_config_set(&other.config, setting, here));
        other.belief.model = other.config.model;
        reseal(&other);
    }
    TEST_ASSERT_EQUAL_INT(PLR_OK, state_bytes_restore(&state, &other));
}

static void test_each_number_of_another_camera_makes_it_foreign(void) {
    plr_camera *camera = &other.camera.given;
    plr_real *const single[] = {&camera->fx, &camera->fy, &camera->cx, &camera->cy,
                                &camera->baseline};
    plr_real *numbers[17];
    memcpy(numbers, single, sizeof single);
    for (unsigned i = 0; i < 9; i++)
        numbers[5 + i] = &camera->R_CB[i];
    for (unsigned i = 0; i < 3; i++)
        numbers[14 + i] = &camera->t_CB[i];
    for (unsigned i = 0; i < 17; i++) {
        const plr_real here = *numbers[i];
        *numbers[i] = here + PLR_R(1e-3);
        reseal(&other);
        refuses(PLR_E_FOREIGN);
        *numbers[i] = here;
        reseal(&other);
    }
    TEST_ASSERT_EQUAL_INT(PLR_OK, state_bytes_restore(&state, &other));
}

/* ---------------------------------------------------------------- no state */

static void test_any_length_but_the_right_one_is_refused(void) {
    const uint32_t length = state.length;
    for (state.length = 0; state.length < length; state.length += state.length < 256 ? 1 : 17)
        refuses(PLR_E_CORRUPT);
    for (unsigned i = 1; i < 40; i++) {
        state.length = length - i;
        refuses(PLR_E_CORRUPT);
        state.length = length + i;
        refuses(PLR_E_CORRUPT);
    }
}

static void test_more_landmarks_than_slots_are_refused(void) {
    filter.config.slots = LANDMARKS + 1;
    reseal(&filter);
    const uint32_t counts[] = {LANDMARKS - 1, LANDMARKS + 1, LANDMARKS + 2, 0x7FFFFFFF, 0xFFFFFFFF};
    for (unsigned i = 0; i < sizeof counts / sizeof *counts; i++) {
        memcpy(state.bytes + state_place("count", "landmarks"), &counts[i], 4);
        refuses(PLR_E_CORRUPT);
    }
}

static void test_numbers_that_are_not_finite_are_refused(void) {
    const double bad[] = {(double)NAN, (double)INFINITY, -(double)INFINITY};
    const uint32_t P_at = place_of_P();
    const uint32_t places[] = {state_place("time", "source.interval_s"),
                               state_place("filter", "motion.core.V"),
                               state_place("filter", "supervisor.statistic"),
                               state_place("slot", "x"),
                               state_place("slot", "beyond"),
                               P_at,
                               P_at + 5 * REAL,
                               state.length - REAL};
    for (unsigned i = 0; i < 3; i++)
        for (unsigned k = 0; k < sizeof places / sizeof *places; k++) {
            state_bytes_save(&state, &filter);
            put_real(places[k], bad[i]);
            refuses(PLR_E_CORRUPT);
        }
}

static void test_a_negative_variance_is_refused_and_a_negative_covariance_is_not(void) {
    for (unsigned row = 0, at = 0; row < 12 + 3 * LANDMARKS; row++, at += row + 1) {
        state_bytes_save(&state, &filter);
        put_real(place_of_P() + at * REAL, -1e-9);
        refuses(PLR_E_CORRUPT);
    }
    state_bytes_save(&state, &filter);
    put_real(place_of_P() + REAL, -1e-9);
    TEST_ASSERT_EQUAL_INT(PLR_OK, state_bytes_restore(&state, &other));
}

static void test_a_flag_is_0_or_1(void) {
    const uint32_t flags[] = {
        state_place("time", "clock_started"),         state_place("time", "source.reading_valid"),
        state_place("filter", "supervisor.outright"), state_place("filter", "supervisor.misfits"),
        state_place("filter", "supervisor.frozen"),   state_place("slot", "known"),
        state_place_of_landmark(1, "known")};
    for (unsigned i = 0; i < sizeof flags / sizeof *flags; i++) {
        state_bytes_save(&state, &filter);
        TEST_ASSERT_LESS_OR_EQUAL_UINT8(1, state.bytes[flags[i]]);
        state.bytes[flags[i]] = 2;
        refuses(PLR_E_CORRUPT);
    }
}

static void test_a_doubt_is_one_of_four(void) {
    const uint32_t at = state_place("filter", "supervisor.doubt");
    state.bytes[at] = PLR_DOUBT_SETTLING + 1;
    refuses(PLR_E_CORRUPT);
    state.bytes[at] = PLR_DOUBT_SETTLING;
    TEST_ASSERT_EQUAL_INT(PLR_OK, state_bytes_restore(&state, &other));
}

static void test_whatever_bit_flips_a_refusal_changes_nothing(void) {
    unsigned refused = 0;
    for (uint32_t bit = 0; bit < 8 * state.length; bit += 13) {
        memcpy(&other, &filter, sizeof other);
        state.bytes[bit / 8] ^= (uint8_t)(1U << bit % 8);
        const plr_status status = state_bytes_restore(&state, &other);
        TEST_ASSERT_TRUE(status == PLR_OK || status == PLR_E_FOREIGN || status == PLR_E_CORRUPT);
        if (status != PLR_OK) {
            TEST_ASSERT_EQUAL_MEMORY(&filter, &other, sizeof other);
            refused++;
        }
        state.bytes[bit / 8] ^= (uint8_t)(1U << bit % 8);
    }
    TEST_ASSERT_GREATER_THAN_UINT(state_place("count", "landmarks") * 8 / 13, refused);
}

/* ---------------------------------------------------------------- sinks and sources that fail */

static void test_a_sink_that_fails_ends_the_save(void) {
    const unsigned calls = state.calls;
    for (unsigned call = 1; call <= calls; call++) {
        state.length = state.calls = 0;
        state.fails_at = call;
        TEST_ASSERT_EQUAL_INT(PLR_E_IO, plr_filter_save(&filter, state_bytes_take, &state));
        TEST_ASSERT_EQUAL_UINT(call, state.calls);
    }
}

/* In the first half of the calls the state is looked at, in the second it is taken. */
static void test_a_source_that_fails_changes_nothing_or_resets_the_filter(void) {
    const unsigned reads = 2 * ((state.length + PLR_STATE_CHUNK - 1) / PLR_STATE_CHUNK);
    for (unsigned call = 1; call <= reads; call++) {
        state.fails_at = call;
        memcpy(&other, &filter, sizeof other);
        if (call <= reads / 2) {
            refuses(PLR_E_IO);
            continue;
        }
        TEST_ASSERT_EQUAL_INT(PLR_E_IO, state_bytes_restore(&state, &other));
        memcpy(&untouched, &filter, sizeof untouched);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_reset(&untouched));
        TEST_ASSERT_TRUE(state_bytes_same_filter(&untouched, &other));
    }
}

static void test_a_source_that_tells_another_story_the_second_time_resets_the_filter(void) {
    const unsigned second = (state.length + PLR_STATE_CHUNK - 1) / PLR_STATE_CHUNK + 1;
    state.flips_at = second; /* the first byte of the magic */
    TEST_ASSERT_EQUAL_INT(PLR_E_FOREIGN, state_bytes_restore(&state, &other));
    TEST_ASSERT_EQUAL_UINT(0, other.belief.count);
    memcpy(&untouched, &filter, sizeof untouched);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_reset(&untouched));
    TEST_ASSERT_TRUE(state_bytes_same_filter(&untouched, &other));
}

/* ---------------------------------------------------------------- filters that cannot */

static void test_a_broken_state_is_not_saved(void) {
    filter.belief.P[2] = -1; /* the variance of rho_y */
    reseal(&filter);
    TEST_ASSERT_EQUAL_INT(PLR_E_DIVERGED, plr_filter_save(&filter, NULL, NULL));
    filter.belief.P[2] = 1;
    filter.belief.P[1] = (plr_real)NAN; /* no variance */
    reseal(&filter);
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_FINITE, plr_filter_save(&filter, NULL, NULL));
    filter.belief.P[1] = 0;
    reseal(&filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_save(&filter, NULL, NULL));
    filter.belief.bias[2] = (plr_real)INFINITY;
    reseal(&filter);
    state.length = state.calls = 0;
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_FINITE, plr_filter_save(&filter, state_bytes_take, &state));
}

static void test_a_diverged_filter_is_sound_again_after_a_restore(void) {
    other.belief.P[0] = -1;
    reseal(&other);
    TEST_ASSERT_EQUAL_INT(PLR_OK, state_bytes_restore(&state, &other));
    TEST_ASSERT_TRUE(state_bytes_same_filter(&filter, &other));
}

static void test_without_init_nothing_is_saved_or_restored(void) {
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_filter_save(NULL, state_bytes_take, &state));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT,
                          plr_filter_restore(NULL, state.length, state_bytes_give, &state));
    TEST_ASSERT_EQUAL_INT(PLR_E_ARGUMENT, plr_filter_restore(&other, state.length, NULL, &state));
    other.magic = 0;
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, plr_filter_save(&other, state_bytes_take, &state));
    refuses(PLR_E_NOT_READY);
}
