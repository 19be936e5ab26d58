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
static double told_share; /* of the way, by wheels that slip */

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
    told_share = 1;
    memset(&driven, 0, sizeof driven);
    memset(&restored, 0, sizeof restored);
}

/* Both filters get the same; `b` may be NULL. */
static void twist(plr_filter *a, plr_filter *b) {
    plr_twist reading = scene_read(&world);
    reading.v_B_mps[0] *= told_share;
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

static void test_a_contradiction_goes_on_with_the_same_bits(void) {
    start(&driven);
    drive(&driven, NULL, 30);
    told_share = 0.5;
    drive(&driven, NULL, 15);
    TEST_ASSERT_EQUAL_UINT8(PLR_DOUBT_CONTRADICTED, driven.supervisor.doubt);
    state_bytes_save(&state, &driven);
    start(&restored);
    TEST_ASSERT_EQUAL_INT(PLR_OK, state_bytes_restore(&state, &restored));
    TEST_ASSERT_TRUE(state_bytes_same_filter(&driven, &restored));
    drive(&driven, &restored, 10);
    told_share = 1;
    drive(&driven, &restored, 40);
    TEST_ASSERT_TRUE(state_bytes_same_filter(&driven, &restored));
}

static void test_known_landmarks_stay_known(void) {
    config.mode = PLR_MODE_LOCALIZATION;
    save_restore_and_go_on(1);
    TEST_ASSERT_GREATER_THAN_UINT(0, restored.belief.count);
    for (unsigned slot = 0; slot < restored.belief.count; slot++)
        TEST_ASSERT_EQUAL_UINT8(1, restored.belief.slots[slot].known);
}

static void test_a_map_in_the_making_goes_on_with_the_same_bits(void) {
    config.mode = PLR_MODE_MAPPING;
    save_restore_and_go_on(1);
}

static void test_twists_alone_go_on_with_the_same_bits(void) {
    config.mode = PLR_MODE_DEAD_RECKONING;
    save_restore_and_go_on(3);
    TEST_ASSERT_EQUAL_UINT(0, restored.belief.count);
}

static void test_a_filter_that_has_seen_nothing_can_be_saved(void) {
    start(&driven);
    state_bytes_save(&state, &driven);
    start(&restored);
    drive(&restored, NULL, 1);
    TEST_ASSERT_EQUAL_INT(PLR_OK, state_bytes_restore(&state, &restored));
    TEST_ASSERT_TRUE(state_bytes_same_filter(&driven, &restored));
}

typedef enum kind { U8, U16, U32, U64, F64, REAL } kind;

/* A field that it is in order to save any number in gets one that it has not by chance. */
static void fill(rng *chance, void *field, kind is, size_t count, unsigned most) {
    static const size_t size[] = {1, 2, 4, 8, sizeof(double), sizeof(plr_real)};
    const size_t bytes = count * size[is];
    for (size_t i = 0; is == REAL && i < bytes / sizeof(plr_real); i++)
        ((plr_real *)field)[i] = (plr_real)(1 + rng_uniform(chance, 0, 1));
    for (size_t i = 0; is == F64 && i < bytes / sizeof(double); i++)
        ((double *)field)[i] = rng_normal(chance);
    for (size_t i = 0; is < F64 && i < bytes; i++)
        ((uint8_t *)field)[i] = (uint8_t)(most ? most : rng_bits(chance));
}

/* All that snapshot.def lists of the filter. What it does not list, and should, the drives above find. */
static void test_every_field_is_carried(void) {
    rng chance = rng_seeded(7);
    bool in_filter = false;
    start(&driven);
    drive(&driven, NULL, 6);
    twist(&driven, NULL);
#define TABLE(name, times) in_filter = strcmp("filter", #name) == 0;
#define GROUP(about)
#define END(name)
#define FIELD(type, member, is, count, most, about) FIELD_OF_##type(member, is, count, most)
#define FIELD_OF_plr_filter(member, is, count, most)                                               \
    if (in_filter)                                                                                 \
        fill(&chance, &driven.member, is, count, most);
#define FIELD_OF_plr_slot(member, is, count, most)
#define FIELD_OF_plr_camera(member, is, count, most)
#define FIELD_OF_plr_state_origin(member, is, count, most)
#define FIELD_OF_plr_state_setting(member, is, count, most)
#define FIELD_OF_plr_state_count(member, is, count, most)
#define FIELD_OF_plr_state_pose(member, is, count, most)
#include "filter/snapshot.def"
    driven.belief.slots[1].beyond = PLR_R(-0.25);
    driven.belief.slots[1].pixel_hash = 0x3456789A;
    driven.belief.slots[1].times_gated = 0x12345678;
    reseal(&driven);
    state_bytes_save(&state, &driven);
    start(&restored);
    TEST_ASSERT_EQUAL_INT(PLR_OK, state_bytes_restore(&state, &restored));
    TEST_ASSERT_TRUE(state_bytes_same_filter(&driven, &restored));
}

static void test_negative_zeros_and_subnormals_keep_their_bits(void) {
    start(&driven);
    drive(&driven, NULL, 3);
    driven.belief.p_WB[0] = -0.0;
    driven.belief.p_WB[1] = 4.9406564584124654e-324;
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
    const uint32_t count_at = 13 + 9 * 62 + 17 * real;
    const uint32_t frames_at = count_at + 4 + 22 + 24 + 2 + 143 * real;
    const uint32_t health_at = frames_at + 212 + 436 * real;
    const uint32_t totals_at = health_at + 25;
    const uint32_t slots_at = totals_at + 68 + 56;
    const uint32_t id_at = slots_at + 4 * real, slot = 8 * real + 35;
    start(&driven);
    drive(&driven, NULL, 5);
    const uint32_t dim = 12 + 3 * driven.belief.count;
    state_bytes_save(&state, &driven);
    TEST_ASSERT_EQUAL_MEMORY("PLRF", state.bytes, 4);
    TEST_ASSERT_EQUAL_UINT32(18, number_at(4, 4));
    TEST_ASSERT_EQUAL_UINT32(plr_build_fingerprint(), number_at(8, 4));
    TEST_ASSERT_EQUAL_UINT(62, state.bytes[12]);
    TEST_ASSERT_EQUAL_UINT(driven.belief.count, number_at(count_at, 4));
    TEST_ASSERT_EQUAL_UINT64(driven.belief.t_ns, number_at(count_at + 4, 8));
    TEST_ASSERT_EQUAL_UINT32(driven.belief.frame_number, number_at(frames_at, 4));
    TEST_ASSERT_EQUAL_UINT8(driven.supervisor.health, number_at(health_at, 1));
    TEST_ASSERT_EQUAL_HEX32(driven.supervisor.reasons, number_at(health_at + 1, 4));
    TEST_ASSERT_EQUAL_UINT64(driven.supervisor.last_frame_ns, number_at(health_at + 5, 8));
    TEST_ASSERT_EQUAL_UINT32(driven.totals.twists, number_at(totals_at, 4));
    TEST_ASSERT_EQUAL_UINT64(driven.totals.created, number_at(totals_at + 68 + 4 * 8, 8));
    TEST_ASSERT_EQUAL_UINT32(driven.belief.slots[0].id, number_at(id_at, 4));
    TEST_ASSERT_EQUAL_UINT32(driven.belief.slots[1].id, number_at(id_at + slot, 4));
    TEST_ASSERT_EQUAL_HEX32(driven.belief.slots[1].pixel_hash, number_at(id_at + slot + 16, 4));
    TEST_ASSERT_EQUAL_UINT32(984 + 596 * real, slots_at);
    TEST_ASSERT_EQUAL_UINT32(slots_at + driven.belief.count * slot +
                                 (dim * (dim + 1) / 2 + 5 * dim + 5) * real,
                             state.length);
}

static void test_the_size_is_known_beforehand(void) {
    start(&driven);
    for (unsigned i = 0; i < 4; i++) {
        state_bytes_save(&state, &driven);
        TEST_ASSERT_EQUAL_UINT32(state.length, plr_filter_saved_size(&driven, driven.belief.count));
        drive(&driven, NULL, 1);
    }
    TEST_ASSERT_EQUAL_UINT(SLOTS, driven.belief.count);
    TEST_ASSERT_EQUAL_UINT32(0, plr_filter_saved_size(&driven, SLOTS + 1));
    TEST_ASSERT_EQUAL_UINT32(0, plr_filter_saved_size(NULL, 0));
    driven.magic = 0;
    TEST_ASSERT_EQUAL_UINT32(0, plr_filter_saved_size(&driven, 0));
}
