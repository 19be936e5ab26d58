// SPDX-License-Identifier: MIT
/* The quaternions of a TUM file. */
#include <unity.h>

#include "posix/trajectory.h"
#include "support/matrices.h"
#include "support/random.h"

/* Of a unit quaternion (x, y, z, w). */
static void rotation(double R[9], const double q[4]) {
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    R[0] = 1 - 2 * (y * y + z * z);
    R[1] = 2 * (x * y - w * z);
    R[2] = 2 * (x * z + w * y);
    R[3] = 2 * (x * y + w * z);
    R[4] = 1 - 2 * (x * x + z * z);
    R[5] = 2 * (y * z - w * x);
    R[6] = 2 * (x * z - w * y);
    R[7] = 2 * (y * z + w * x);
    R[8] = 1 - 2 * (x * x + y * y);
}

static void test_quaternions_give_their_rotation_back(void) {
    rng r = rng_seeded(2);
    for (int n = 0; n < 500; n++) {
        double R[9], q[4], back[9];
        random_rotation(&r, R);
        rotation_quaternion(q, R);
        rotation(back, q);
        TEST_ASSERT_TRUE(q[3] >= 0);
        TEST_ASSERT_TRUE(largest_difference(R, back, 9) < 1e-14);
    }
}
