// SPDX-License-Identifier: MIT
/*
 * Each observation is linearised once in a frame, in every mode and in both models: gate and
 * correction share the result. Every derivative by the state comes from plr_model.derive, so the
 * library's models are replaced, for this program, by their own sources with a derive that counts
 * its calls.
 */
#include <string.h>
#include <unity.h>

#define plr_model_body  real_body
#define plr_model_world real_world
#include "state/model_body.c"
#include "state/model_world.c"
#undef plr_model_body
#undef plr_model_world

#include "support/rig.h"

extern struct plr_model plr_model_body, plr_model_world; /* filled by setUp */
struct plr_model plr_model_body, plr_model_world;

enum { FRAMES = 25, FEW = 7 };

static unsigned calls[SCENE_MAX_LANDMARKS + 100]; /* of this frame, by the landmark's id */

static void count(const plr_belief *belief, unsigned slot) {
    TEST_ASSERT_LESS_THAN_UINT(sizeof calls / sizeof *calls, belief->slots[slot].id);
    calls[belief->slots[slot].id]++;
}

static void derive_body(const plr_belief *belief, const plr_camera_model *camera, unsigned slot,
                        const plr_view *view, const plr_real Dz[9], const plr_real along[3],
                        plr_real z[3], plr_rows *H) {
    count(belief, slot);
    real_body.derive(belief, camera, slot, view, Dz, along, z, H);
}

static void derive_world(const plr_belief *belief, const plr_camera_model *camera, unsigned slot,
                         const plr_view *view, const plr_real Dz[9], const plr_real along[3],
                         plr_real z[3], plr_rows *H) {
    count(belief, slot);
    real_world.derive(belief, camera, slot, view, Dz, along, z, H);
}

static bool source(void *context, uint32_t id, plr_landmark *landmark) {
    *landmark = scene_known(context, id, 0.05);
    return true;
}

void setUp(void) {
    plr_model_body = real_body;
    plr_model_body.derive = derive_body;
    plr_model_world = real_world;
    plr_model_world.derive = derive_world;
    rig_set_up();
    rig.map = (plr_map){.context = &rig.world};
    rig.options.outliers = 0.1; /* some are rejected */
}

static void move_on(void) {
    if (rig.config.mode != PLR_MODE_MAPPING) {
        rig_twists();
        return;
    }
    plr_pose pose;
    scene_move(&rig.world, RIG_TWISTS * RIG_STEP_NS);
    scene_pose(&rig.world, &pose);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_move_to(&rig.filter, rig.world.t_ns, &pose));
}

/* Drives on; of every other frame the budget leaves out most observations. `found`: the motion is
 * found first, and judges the observations; only those that are used are then linearised. */
static void check_drive(plr_model_kind model, plr_mode mode, bool found) {
    unsigned used = 0, gated = 0, left_out = 0;
    rig.config.model = (uint8_t)model;
    rig_begin_with(mode, mode == PLR_MODE_SLAM);
    for (unsigned k = 0; k < FRAMES; k++) {
        unsigned sum = 0;
        move_on();
        plr_frame frame = scene_look(&rig.world);
        frame.budget = k % 2 ? FEW : PLR_NO_BUDGET;
        memset(calls, 0, sizeof calls);
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, &rig.report));
        for (unsigned id = 0; id < sizeof calls / sizeof *calls; id++) {
            TEST_ASSERT_LESS_OR_EQUAL_UINT(1, calls[id]);
            sum += calls[id];
        }
        TEST_ASSERT_EQUAL_UINT(found ? rig.report.used : rig.report.matched, sum);
        used += rig.report.used;
        gated += rig.report.gated;
        left_out += rig.report.left_out;
    }
    TEST_ASSERT_GREATER_THAN_UINT(10 * FEW, used);
    TEST_ASSERT_GREATER_THAN_UINT(0, gated);
    TEST_ASSERT_GREATER_THAN_UINT(0, left_out);
}

static void test_after_the_search_for_the_motion_what_is_used_is_linearised_once(void) {
    check_drive(PLR_MODEL_BODY, PLR_MODE_SLAM, true);
}

static void test_in_the_world_each_observation_is_linearised_once(void) {
    check_drive(PLR_MODEL_WORLD, PLR_MODE_SLAM, false);
}

static void test_in_localization_each_observation_is_linearised_once(void) {
    rig.map.source = source;
    check_drive(PLR_MODEL_BODY, PLR_MODE_LOCALIZATION, true);
    check_drive(PLR_MODEL_WORLD, PLR_MODE_LOCALIZATION, false);
}

static void test_in_mapping_each_observation_is_linearised_once(void) {
    check_drive(PLR_MODEL_BODY, PLR_MODE_MAPPING, false);
    check_drive(PLR_MODEL_WORLD, PLR_MODE_MAPPING, false);
}
