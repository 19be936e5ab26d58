// SPDX-License-Identifier: MIT
/* What the parts of the process `imu` share. */
#ifndef PLR_PROCESS_IMU_H
#define PLR_PROCESS_IMU_H

#include "pelorus/state.h"

/* gamma = R_WB^T (0, 0, -g): gravity's acceleration in body axes, m/s^2. */
void plr_imu_gravity(const plr_filter *f, plr_real gamma[3]);

#endif
