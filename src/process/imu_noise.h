// SPDX-License-Identifier: MIT
/* The covariance of the noise of an IMU's motion, carried along by a step: where most of a reading's time goes. */
#ifndef PLR_PROCESS_IMU_NOISE_H
#define PLR_PROCESS_IMU_NOISE_H

#include "pelorus/belief.h"

/* The core's rows (rho, theta, v, b_a, b_g); a step changes the first PLR_CORE_MOVED. */
enum {
    PLR_CORE_THETA = 3,
    PLR_CORE_VEL = 6,
    PLR_CORE_ACCEL = 9,
    PLR_CORE_GYRO = 12,
    PLR_CORE_MOVED = 9
};

/* Q <- F Q F^T + noise. F is 9 x 15, the rows that a step changes; of theta's only the columns theta and b_g are
 * read, of v's none of rho: the others are zero. The noise of the readings, of variances `reading`
 * (accelerometer, gyro), enters as an error of the biases does that lasts for this step alone. Of Q, which is
 * zero after a frame, these remain zero: what theta has in common with b_a, and the biases beside their diagonal. */
static inline void plr_imu_carry_noise(plr_motion *motion,
                                       const plr_real F[PLR_CORE_MOVED * PLR_CORE_DIM],
                                       const plr_real reading[2]);

/* The two ways to do it, which give the same numbers: the blocks that are not zero, and whole rows, which take the
 * vectors of a large processor. */
void plr_imu_carry_by_blocks(plr_motion *motion, const plr_real F[PLR_CORE_MOVED * PLR_CORE_DIM],
                             const plr_real reading[2]);
void plr_imu_carry_in_rows(plr_motion *motion, const plr_real F[PLR_CORE_MOVED * PLR_CORE_DIM],
                           const plr_real reading[2]);

static inline void plr_imu_carry_noise(plr_motion *motion,
                                       const plr_real F[PLR_CORE_MOVED * PLR_CORE_DIM],
                                       const plr_real reading[2]) {
    if (PLR_TILE_COLUMNS >= 8)
        plr_imu_carry_in_rows(motion, F, reading);
    else
        plr_imu_carry_by_blocks(motion, F, reading);
}

#endif
