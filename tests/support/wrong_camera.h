// SPDX-License-Identifier: MIT
/* A camera whose calibration is told wrong, and how far off the filter is that estimates it. */
#ifndef PELORUS_TESTS_WRONG_CAMERA_H
#define PELORUS_TESTS_WRONG_CAMERA_H

#include "pelorus/filter.h"
#include "support/random.h"

/* By how much each number is to be corrected, drawn as its sigma says. */
void wrong_camera_draw(rng *chance, const plr_config *config, double error[PLR_CALIBRATION_ERRORS]);

/* What is told of the true camera: it, less its errors. That of the clock is no part of it. */
plr_calibration wrong_camera(const plr_calibration *truth,
                             const double error[PLR_CALIBRATION_ERRORS]);

/* The covariance that the filter tells of its errors, m x m, in the order of its columns: G D G^T. */
void wrong_camera_covariance(const plr_filter *f, double *Sigma);

/* e^T Sigma^-1 e of all errors that the filter estimates. */
double wrong_camera_squared_error(const plr_filter *f, const double error[PLR_CALIBRATION_ERRORS]);

#endif
