// SPDX-License-Identifier: MIT
/* The pose that a filter has now, where it must have one. */
#ifndef PELORUS_TEST_POSE_OF_H
#define PELORUS_TEST_POSE_OF_H

#include "pelorus/filter.h"

plr_pose pose_of(const plr_filter *f);

#endif
