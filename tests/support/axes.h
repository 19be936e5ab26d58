// SPDX-License-Identifier: MIT
/* A sigma that is the same for the three axes of the body. */
#ifndef PELORUS_TEST_AXES_H
#define PELORUS_TEST_AXES_H

static inline void each_axis(double sigma[3], double value) {
    sigma[0] = sigma[1] = sigma[2] = value;
}

#endif
