// SPDX-License-Identifier: MIT
#include "support/rig.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "state/covariance.h"
#include "support/exact_camera.h"
#include "support/oracle.h"
#include "support/rigid.h"
#include "support/specimens.h"

rig_state rig;

const plr_pose rig_identity = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0}};

void rig_set_up(void) {
    scene_options_default(&rig.options);
    scene_calibration(&rig.calibration);
    plr_config_default(&rig.config);
    exact_camera(&rig.config);
    memset(&rig.map, 0, sizeof rig.map);
    rig_begin();
}

void rig_begin(void) {
    scene_start(&rig.world, &rig.options);
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_filter_init(&rig.filter, &rig.calibration, &rig.config, &rig.map));
}

void rig_begin_with(plr_mode mode, bool bias) {
    rig.config.mode = (uint8_t)mode;
    rig.config.bias = bias;
    rig_begin();
}

static void predict(const plr_twist *twist) {
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&rig.filter, rig.world.t_ns, twist));
}

void rig_twist(void) {
    const plr_twist twist = scene_read(&rig.world);
    predict(&twist);
    scene_move(&rig.world, RIG_STEP_NS);
}

void rig_twists(void) {
    for (unsigned i = 0; i < RIG_TWISTS; i++)
        rig_twist();
}

void rig_twists_in_place(double speed_mps) {
    const plr_twist twist = {{speed_mps, 0, 0}, {0}};
    for (unsigned i = 0; i < RIG_TWISTS; i++) {
        rig.world.t_ns += RIG_STEP_NS;
        predict(&twist);
    }
}

void rig_frame(void) {
    const plr_frame frame = scene_look(&rig.world);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, &rig.report));
}

void rig_drive(unsigned frames) {
    for (unsigned k = 0; k < frames; k++) {
        rig_twists();
        rig_frame();
    }
}

void rig_drive_told(unsigned frames, double share) {
    for (unsigned k = 0; k < frames; k++) {
        for (unsigned i = 0; i < RIG_TWISTS; i++) {
            plr_twist twist = scene_read(&rig.world);
            for (int axis = 0; axis < 3; axis++)
                twist.v_B_mps[axis] *= share;
            predict(&twist);
            scene_move(&rig.world, RIG_STEP_NS);
        }
        rig_frame();
    }
}

void rig_stand(unsigned frames) {
    for (unsigned k = 0; k < frames; k++) {
        for (unsigned i = 0; i < RIG_TWISTS; i++) {
            const plr_twist twist = scene_read(&rig.world);
            predict(&twist);
            rig.world.t_ns += RIG_STEP_NS; /* and nothing moves */
        }
        rig_frame();
    }
}

double rig_squared_error(double e[6]) {
    double P[36], T[16], inverse[16], E[16], weighted[6], sum = 0;
    const plr_pose pose = pose_of(&rig.filter);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
    rigid_from_pose(T, &pose);
    rigid_inverse(inverse, T);
    square_multiply(4, inverse, rig.world.T_WB, E);
    rigid_log(e, E);
    memcpy(weighted, e, 6 * sizeof *e);
    TEST_ASSERT_TRUE(oracle_solve_spd(6, 1, P, weighted));
    for (int i = 0; i < 6; i++)
        sum += e[i] * weighted[i];
    return sum;
}

double rig_sigma_m(void) {
    double P[36];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&rig.filter, P));
    return sqrt(P[0] + P[7] + P[14]);
}

double rig_smallest_correlation(void) {
    const unsigned n = plr_covariance_dim(&rig.filter.belief);
    double *P = specimen_covariance(&rig.filter), *C = specimen_zeros(n, n);
    for (unsigned i = 0; i < n; i++)
        for (unsigned j = 0; j < n; j++)
            C[i * n + j] = P[i * n + j] / sqrt(P[i * n + i] * P[j * n + j]);
    const double smallest = oracle_smallest_eigenvalue(n, C);
    free(C);
    free(P);
    return smallest;
}

void rig_remember(void) {
    memcpy(&rig.before, &rig.filter, sizeof rig.before);
}

void rig_demand_untouched(plr_status expected, plr_status got) {
    TEST_ASSERT_EQUAL_INT(expected, got);
    TEST_ASSERT_TRUE_MESSAGE(specimen_same_state(&rig.before, &rig.filter),
                             "a refused call changed the state");
    TEST_ASSERT_EQUAL_UINT32(rig.before.totals.resets, rig.filter.totals.resets);
    TEST_ASSERT_EQUAL_UINT32(rig.before.totals.frames, rig.filter.totals.frames);
    TEST_ASSERT_EQUAL_UINT32(rig.before.totals.twists, rig.filter.totals.twists);
}

void rig_demand_refusal(plr_status expected, plr_status got) {
    rig_demand_untouched(expected, got);
    const bool late = expected == PLR_E_LATE;
    TEST_ASSERT_EQUAL_UINT32(rig.before.totals.late + late, rig.filter.totals.late);
    TEST_ASSERT_EQUAL_UINT32(rig.before.totals.refused + !late, rig.filter.totals.refused);
    rig_remember();
}
