// SPDX-License-Identifier: MIT
/* A filter that is saved and restored is the same filter, to the bit. */
#include <string.h>
#include <unity.h>

#include "support/reseal.h"
#include "support/scene.h"
#include "support/specimens.h"
#include "support/state_bytes.h"

enum { SLOTS = 8, TWISTS_PER_FRAME = 5 };

static plr_filter driven, restored;
static state_bytes state, other;
static scene world;
static plr_config config;

static bool know_all(void *context, uint32_t id, plr_landmark *landmark) {
    *landmark = scene_known(context, id, 0.01);
    return true;
}

static void start(plr_filter *f) {
    const plr_map map = {&world, NULL, know_all};
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(f, &world.calibration, &config, &map));
}

void setUp(void) {
    scene_options options;
    scene_options_default(&options);
    options.most_seen = SLOTS + 2; /* some find no room: slots are given up and taken anew */
    options.outliers = 0.1;
    scene_start(&world, &options);
    plr_config_default(&config);
    config.slots = SLOTS;
    config.bias = 1;
    memset(&driven, 0, sizeof driven);
    memset(&restored, 0, sizeof restored);
}

/* Both filters get the same; `b` may be NULL. */
static void twist(plr_filter *a, plr_filter *b) {
    const plr_twist reading = scene_read(&world);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(a, world.t_ns, &reading));
    if (b)
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(b, world.t_ns, &reading));
    scene_move(&world, 20000000);
}

static void frame(plr_filter *a, plr_filter *b) {
    plr_report reports[2];
    plr_pose pose;
    const plr_frame seen = scene_look(&world);
    if (config.mode == PLR_MODE_MAPPING) {
        scene_pose(&world, &pose);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_move_to(a, world.t_ns, &pose));
        if (b)
            TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_move_to(b, world.t_ns, &pose));
    }
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(a, &seen, &reports[0]));
    if (!b)
        return;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(b, &seen, &reports[1]));
    TEST_ASSERT_EQUAL_MEMORY(&reports[0], &reports[1], sizeof reports[0]);
}

static void drive(plr_filter *a, plr_filter *b, unsigned frames) {
    for (unsigned i = 0; i < frames; i++) {
        for (unsigned k = 0; k < TWISTS_PER_FRAME; k++)
            twist(a, b);
        frame(a, b);
    }
}

/* Drives, saves with a twist or two on top of the last frame, restores, and drives both on. */
static void save_restore_and_go_on(unsigned twists_behind) {
    start(&driven);
    drive(&driven, NULL, 6);
    for (unsigned i = 0; i < twists_behind; i++)
        twist(&driven, NULL);
    state_bytes_save(&state, &driven);
    start(&restored);
    TEST_ASSERT_EQUAL_INT(PLR_OK, state_bytes_restore(&state, &restored));
    TEST_ASSERT_TRUE(state_bytes_same_filter(&driven, &restored));
    drive(&driven, &restored, 12);
    TEST_ASSERT_TRUE(state_bytes_same_filter(&driven, &restored));
}

/* With twists they are saved as the numbers of an IMU's motion, which stand in the same place. */
static void test_votes_fit_where_they_are_saved(void) {
    TEST_ASSERT_LESS_OR_EQUAL_UINT(sizeof(plr_core_motion), sizeof(plr_votes));
}

static void test_a_restored_filter_goes_on_with_the_same_bits(void) {
    save_restore_and_go_on(0);
    TEST_ASSERT_GREATER_THAN_UINT64(0, driven.totals.evicted);
    TEST_ASSERT_GREATER_THAN_UINT64(0, driven.totals.gated);
}

static void test_motion_that_is_not_applied_yet_is_carried_too(void) {
    save_restore_and_go_on(2);
}

static void test_the_world_model_and_a_filter_without_bias_go_on_with_the_same_bits(void) {
    config.model = PLR_MODEL_WORLD;
    config.bias = 0;
    config.max_depth_m = 20;
    save_restore_and_go_on(1);
}

static void test_known_landmarks_stay_known(void) {
    config.mode = PLR_MODE_LOCALIZATION;
    save_restore_and_go_on(1);
    TEST_ASSERT_GREATER_THAN_UINT(0, restored.count);
    for (unsigned slot = 0; slot < restored.count; slot++)
        TEST_ASSERT_EQUAL_UINT8(1, restored.slots[slot].known);
}

static void test_a_map_in_the_making_goes_on_with_the_same_bits(void) {
    config.mode = PLR_MODE_MAPPING;
    save_restore_and_go_on(1);
}

static void test_twists_alone_go_on_with_the_same_bits(void) {
    config.mode = PLR_MODE_DEAD_RECKONING;
    save_restore_and_go_on(3);
    TEST_ASSERT_EQUAL_UINT(0, restored.count);
}

static void test_a_filter_that_has_seen_nothing_can_be_saved(void) {
    start(&driven);
    state_bytes_save(&state, &driven);
    start(&restored);
    drive(&restored, NULL, 1);
    TEST_ASSERT_EQUAL_INT(PLR_OK, state_bytes_restore(&state, &restored));
    TEST_ASSERT_TRUE(state_bytes_same_filter(&driven, &restored));
}

static void fill_reals(rng *chance, plr_real *x, unsigned n) {
    for (unsigned i = 0; i < n; i++)
        x[i] = (plr_real)rng_normal(chance);
}

/* Every field of a struct that is plain numbers gets one that it has not by chance. */
static void fill_consistency(rng *chance, plr_consistency *c) {
    for (unsigned w = 0; w < PLR_CONSISTENCY_WINDOWS; w++) {
        fill_reals(chance, c->windows[w].sum, 6);
        fill_reals(chance, c->windows[w].variance, 21);
    }
    fill_reals(chance, c->difference, 6);
    fill_reals(chance, c->difference_sigmas, 6);
    fill_reals(chance, &c->difference_noise, 1);
    fill_reals(chance, c->frozen_motion, 6);
    fill_reals(chance, c->frozen_variance, 6);
    fill_reals(chance, &c->excess, 1);
    fill_reals(chance, &c->excess_turn, 1);
    c->agreeing_frames = 0x1122;
    c->contradicting_frames = 0x3344;
    c->small_frames = 0x5566;
    c->doubted_frames = 0x7788;
    c->contradicted = c->drifting = c->frozen = 1;
    c->settling_frames = 15;
}

static void fill_scene(rng *chance, plr_scene *s) {
    plr_real *const sums[] = {&s->matched, &s->rejected, &s->nis, &s->usual_mean, &s->usual_square};
    for (unsigned i = 0; i < sizeof sums / sizeof *sums; i++)
        fill_reals(chance, sums[i], 1);
}

/* A field that a later version adds to the filter, and forgets here, is found by this. */
static void test_every_field_is_carried(void) {
    plr_totals *t = &driven.totals;
    uint32_t *const counts[] = {
        &t->twists,         &t->frames,         &t->late,           &t->refused, &t->resets,
        &t->locks,          &t->range_limited,  &t->blocks_failed,  &t->widened, &t->recoveries,
        &t->contradictions, &t->twists_refused, &t->frames_refused, &t->damaged};
    uint64_t *const sums[] = {&t->observations, &t->matched, &t->used,       &t->gated,
                              &t->created,      &t->evicted, &t->diverged_ns};
    rng chance = rng_seeded(7);
    start(&driven);
    drive(&driven, NULL, 6);
    twist(&driven, NULL);
    for (unsigned i = 0; i < sizeof counts / sizeof *counts; i++)
        *counts[i] = (uint32_t)rng_bits(&chance);
    for (unsigned i = 0; i < sizeof sums / sizeof *sums; i++)
        *sums[i] = rng_bits(&chance);
    fill_reals(&chance, driven.motion.B, PLR_MOTION_BY);
    fill_reals(&chance, (plr_real *)(void *)&driven.own.core_motion,
               sizeof driven.own.core_motion / sizeof(plr_real));
    fill_reals(&chance, driven.inertial.velocity, PLR_VELOCITY_DIM);
    fill_reals(&chance, driven.inertial.slow, PLR_POSE_DIM);
    fill_reals(&chance, driven.inertial.change2, 2);
    fill_reals(&chance, driven.inertial.spread2, 2);
    fill_reals(&chance, &driven.inertial.usual_s, 1);
    driven.inertial.started_ns = rng_bits(&chance);
    driven.inertial.still_ns = rng_bits(&chance);
    driven.inertial.repeated = 0x1A2B;
    driven.inertial.out_of_line = 0x3C4D;
    driven.inertial.frames = 0x5E6F;
    driven.inertial.started = driven.inertial.pose_given = driven.inertial.anchored = 1;
    driven.inertial.fault = PLR_IMU_FAULT_SPIKE;
    fill_reals(&chance, driven.bias, PLR_BIAS_DIM);
    fill_reals(&chance, driven.bias_prior, PLR_BIAS_DIM);
    fill_reals(&chance, driven.bias_prior_sigma, PLR_BIAS_DIM);
    driven.bias_walked_s = 12345.678;
    fill_reals(&chance, driven.recovery_P, 21);
    fill_consistency(&chance, &driven.consistency);
    fill_scene(&chance, &driven.scene);
    driven.health = PLR_HEALTH_LOST;
    driven.reasons = 0x12345678;
    driven.last_frame_ns = rng_bits(&chance);
    driven.last_use_ns = rng_bits(&chance);
    driven.refused_before = 0x23456789;
    driven.slots[1].beyond = PLR_R(-0.25);
    driven.slots[1].pixel_hash = 0x3456789A;
    driven.frame_number = (uint32_t)rng_bits(&chance);
    driven.frames_without_use = 0xA1B2;
    driven.frames_mostly_gated = 0xC3D4;
    driven.frames_off_the_map = 0xE5F6;
    driven.matches_since_gated = 0xE5F60718;
    driven.slots[1].times_gated = 0x12345678;
    reseal(&driven);
    state_bytes_save(&state, &driven);
    start(&restored);
    TEST_ASSERT_EQUAL_INT(PLR_OK, state_bytes_restore(&state, &restored));
    TEST_ASSERT_TRUE(state_bytes_same_filter(&driven, &restored));
}

static void test_negative_zeros_and_subnormals_keep_their_bits(void) {
    start(&driven);
    drive(&driven, NULL, 3);
    driven.p_WB[0] = -0.0;
    driven.p_WB[1] = 4.9406564584124654e-324;
    driven.motion.p[2] = -PLR_SMALLEST_NORMAL / 2;
    reseal(&driven);
    state_bytes_save(&state, &driven);
    start(&restored);
    TEST_ASSERT_EQUAL_INT(PLR_OK, state_bytes_restore(&state, &restored));
    TEST_ASSERT_TRUE(state_bytes_same_filter(&driven, &restored));
}

static void test_saving_changes_nothing(void) {
    static plr_filter before;
    start(&driven);
    drive(&driven, NULL, 4);
    twist(&driven, NULL);
    memcpy(&before, &driven, sizeof before);
    state_bytes_save(&state, &driven);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_save(&driven, NULL, NULL));
    TEST_ASSERT_EQUAL_MEMORY(&before, &driven, sizeof before);
}

static void test_what_is_restored_is_saved_as_the_same_bytes(void) {
    start(&driven);
    drive(&driven, NULL, 5);
    state_bytes_save(&state, &driven);
    start(&restored);
    TEST_ASSERT_EQUAL_INT(PLR_OK, state_bytes_restore(&state, &restored));
    state_bytes_save(&other, &restored);
    TEST_ASSERT_TRUE(state_bytes_same(&state, &other));
}

static void test_bytes_are_handed_over_in_order_and_in_small_pieces(void) {
    start(&driven);
    drive(&driven, NULL, 5);
    state_bytes_save(&state, &driven);
    TEST_ASSERT_EQUAL_UINT(PLR_STATE_CHUNK, state.most_at_once);
    TEST_ASSERT_EQUAL_INT(PLR_OK, state_bytes_restore(&state, &driven));
    TEST_ASSERT_EQUAL_UINT(PLR_STATE_CHUNK, state.most_at_once);
    TEST_ASSERT_FALSE(state.out_of_order);
    TEST_ASSERT_EQUAL_UINT(2 * ((state.length + PLR_STATE_CHUNK - 1) / PLR_STATE_CHUNK),
                           state.calls);
}

static uint64_t number_at(uint32_t offset, unsigned bytes) {
    uint64_t number = 0;
    for (unsigned i = 0; i < bytes; i++)
        number |= (uint64_t)state.bytes[offset + i] << (8 * i);
    return number;
}

/* docs/STATE-FORMAT.md, by its own figures. */
static void test_the_layout_is_the_documented_one(void) {
    const uint32_t real = sizeof(plr_real);
    const uint32_t count_at = 13 + 9 * 54 + 17 * real;
    const uint32_t frames_at = count_at + 4 + 16 + 2 + 24 + 2 + 143 * real;
    const uint32_t health_at = frames_at + 4 + 16 + 10 + 8 + 4 + 8 + 376 * real + 2;
    const uint32_t totals_at = health_at + 5 + 16 + 6 + 8;
    const uint32_t slots_at = totals_at + 68 + 56;
    const uint32_t id_at = slots_at + 4 * real, slot = 8 * real + 35;
    start(&driven);
    drive(&driven, NULL, 5);
    const uint32_t dim = 12 + 3 * driven.count;
    state_bytes_save(&state, &driven);
    TEST_ASSERT_EQUAL_MEMORY("PLRF", state.bytes, 4);
    TEST_ASSERT_EQUAL_UINT32(10, number_at(4, 4));
    TEST_ASSERT_EQUAL_UINT32(plr_build_fingerprint(), number_at(8, 4));
    TEST_ASSERT_EQUAL_UINT(54, state.bytes[12]);
    TEST_ASSERT_EQUAL_UINT(driven.count, number_at(count_at, 4));
    TEST_ASSERT_EQUAL_UINT64(driven.t_ns, number_at(count_at + 4, 8));
    TEST_ASSERT_EQUAL_UINT32(driven.frame_number, number_at(frames_at, 4));
    TEST_ASSERT_EQUAL_UINT8(driven.health, number_at(health_at, 1));
    TEST_ASSERT_EQUAL_HEX32(driven.reasons, number_at(health_at + 1, 4));
    TEST_ASSERT_EQUAL_UINT64(driven.last_frame_ns, number_at(health_at + 5, 8));
    TEST_ASSERT_EQUAL_UINT32(driven.totals.twists, number_at(totals_at, 4));
    TEST_ASSERT_EQUAL_UINT64(driven.totals.created, number_at(totals_at + 68 + 4 * 8, 8));
    TEST_ASSERT_EQUAL_UINT32(driven.slots[0].id, number_at(id_at, 4));
    TEST_ASSERT_EQUAL_UINT32(driven.slots[1].id, number_at(id_at + slot, 4));
    TEST_ASSERT_EQUAL_HEX32(driven.slots[1].pixel_hash, number_at(id_at + slot + 16, 4));
    TEST_ASSERT_EQUAL_UINT32(758 + 536 * real, slots_at);
    TEST_ASSERT_EQUAL_UINT32(
        slots_at + driven.count * slot + (dim * (dim + 1) / 2 + 5 * dim) * real, state.length);
}

static void test_the_size_is_known_beforehand(void) {
    start(&driven);
    for (unsigned i = 0; i < 4; i++) {
        state_bytes_save(&state, &driven);
        TEST_ASSERT_EQUAL_UINT32(state.length, plr_filter_saved_size(&driven, driven.count));
        drive(&driven, NULL, 1);
    }
    TEST_ASSERT_EQUAL_UINT(SLOTS, driven.count);
    TEST_ASSERT_EQUAL_UINT32(0, plr_filter_saved_size(&driven, SLOTS + 1));
    TEST_ASSERT_EQUAL_UINT32(0, plr_filter_saved_size(NULL, 0));
    driven.magic = 0;
    TEST_ASSERT_EQUAL_UINT32(0, plr_filter_saved_size(&driven, 0));
}
