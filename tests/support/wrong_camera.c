// SPDX-License-Identifier: MIT
#include "support/wrong_camera.h"

#include <string.h>
#include <unity.h>

#include "support/oracle.h"
#include "support/rigid.h"

enum { ERRORS = PLR_CALIBRATION_ERRORS };

void wrong_camera_draw(rng *chance, const plr_config *config, double error[ERRORS]) {
    const double sigma[ERRORS] = {
        config->baseline_sigma,        config->focal_sigma,           config->camera_turn_sigma_rad,
        config->camera_turn_sigma_rad, config->camera_turn_sigma_rad, config->centre_sigma_px,
        config->centre_sigma_px,       config->camera_place_sigma_m,  config->camera_place_sigma_m,
        config->camera_place_sigma_m,  config->camera_clock_sigma_s};
    for (unsigned k = 0; k < ERRORS; k++)
        error[k] = k < PLR_WHEEL_SCALE ? sigma[k] * rng_normal(chance) : 0;
}

plr_calibration wrong_camera(const plr_calibration *truth, const double error[ERRORS]) {
    plr_calibration told = *truth;
    double back[6], E[16], T[16], before[16];
    told.baseline_m /= 1 + error[PLR_BASELINE];
    told.fx_px /= 1 + error[PLR_FOCAL_LENGTH];
    told.fy_px /= 1 + error[PLR_FOCAL_LENGTH];
    told.cx_px -= error[PLR_CENTRE_X];
    told.cy_px -= error[PLR_CENTRE_Y];
    for (unsigned i = 0; i < 3; i++) {
        back[i] = -error[PLR_CAMERA_PLACE_X + i];
        back[3 + i] = -error[PLR_CAMERA_TURN_X + i];
    }
    rigid_exp(E, back);
    rigid_from_pose(T, &truth->T_CB);
    square_multiply(4, E, T, before);
    rigid_to_pose(&told.T_CB, before);
    return told;
}

void wrong_camera_covariance(const plr_filter *f, double *Sigma) {
    const plr_error_columns *errors = &f->camera.errors;
    const unsigned m = errors->count;
    memset(Sigma, 0, m * m * sizeof *Sigma);
    for (unsigned k = 0; k < m; k++) {
        const plr_real *G = f->camera.estimate.factor + PLR_CALIBRATIONS * k;
        const double D = (double)(errors->variance[k] * f->camera.estimate.told[k]);
        for (unsigned i = 0; i <= k; i++)
            for (unsigned j = 0; j <= k; j++)
                Sigma[m * i + j] += D * (double)G[i] * (double)G[j];
    }
}

double wrong_camera_squared_error(const plr_filter *f, const double error[ERRORS]) {
    const plr_error_columns *errors = &f->camera.errors;
    const unsigned m = errors->count;
    double Sigma[ERRORS * ERRORS], e[ERRORS], x[ERRORS], sum = 0;
    TEST_ASSERT_EQUAL_UINT(m, errors->estimated);
    wrong_camera_covariance(f, Sigma);
    for (unsigned k = 0; k < m; k++)
        x[k] = e[k] = (double)f->camera.estimate.moved[k] - error[errors->kind[k]];
    TEST_ASSERT_TRUE(oracle_solve_spd(m, 1, Sigma, x));
    for (unsigned k = 0; k < m; k++)
        sum += x[k] * e[k];
    return sum;
}
