// SPDX-License-Identifier: MIT
#include "support/pose_of.h"

#include <unity.h>

plr_pose pose_of(const plr_filter *f) {
    plr_pose pose;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose(f, &pose));
    return pose;
}
