// SPDX-License-Identifier: MIT
/* A specimen (support/specimens.h) in double. */
#ifndef PELORUS_TEST_DENSE_SPECIMEN_H
#define PELORUS_TEST_DENSE_SPECIMEN_H

#include "support/dense_ekf.h"

/* The filter's pose and camera, in a textbook filter without landmarks. */
void specimen_twin(const plr_filter *f, dense_ekf *e);

#endif
