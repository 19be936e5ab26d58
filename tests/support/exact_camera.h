// SPDX-License-Identifier: MIT
/* The settings of a simulated camera: its calibration has no error. */
#ifndef PELORUS_TEST_EXACT_CAMERA_H
#define PELORUS_TEST_EXACT_CAMERA_H

#include "pelorus/settings.h"

static inline void exact_camera(plr_config *config) {
    config->focal_sigma = config->baseline_sigma = config->camera_turn_sigma_rad = 0;
}

#endif
