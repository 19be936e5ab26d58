// SPDX-License-Identifier: MIT
/* A point that came back after a second out of sight, and was rejected once, was dropped and born anew
 * where twists are uncertain by many pixels a frame, although the frames between had measured the motion:
 * on Starry Night, where the same twenty points come back for three minutes, the error doubled. */
#include <unity.h>

#include "support/rig.h"

enum { HIDDEN = 15 };

void setUp(void) {
    rig_set_up();
    for (int i = 0; i < 3; i++)
        rig.config.gyro_sigma[i] = 1.5; /* 20 px from frame to frame */
    rig_begin();
}

static const plr_slot *slot_of(uint32_t id) {
    for (unsigned i = 0; i < rig.filter.belief.count; i++)
        if (rig.filter.belief.slots[i].id == id)
            return &rig.filter.belief.slots[i];
    return NULL;
}

/* A frame of a body that stands, in which the first observation is missing, or off by `wrong_px`. */
static void frame_with_one(bool missing, float wrong_px) {
    rig_twists_in_place(0);
    plr_frame frame = scene_look(&rig.world);
    plr_observation *first = &rig.world.seen[0];
    first->uL_px += wrong_px;
    first->uR_px += wrong_px;
    if (missing) {
        frame.observations++;
        frame.count--;
    }
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, &rig.report));
}

static void test_a_point_that_returns_and_is_rejected_once_stays_as_it_was(void) {
    for (int k = 0; k < 20; k++)
        frame_with_one(false, 0);
    const uint32_t id = rig.world.seen[0].id;
    TEST_ASSERT_NOT_NULL(slot_of(id));
    const plr_real range = slot_of(id)->x[2];
    for (int k = 0; k < HIDDEN; k++)
        frame_with_one(true, 0);
    frame_with_one(false, 80);
    TEST_ASSERT_EQUAL_UINT16(1, rig.report.gated);
    TEST_ASSERT_EQUAL_UINT16(0, rig.report.created);
    frame_with_one(false, 0);
    TEST_ASSERT_EQUAL_UINT16(0, rig.report.gated);
    TEST_ASSERT_DOUBLE_WITHIN(0.05 * (double)range, (double)range, (double)slot_of(id)->x[2]);
}
