// SPDX-License-Identifier: MIT
/*
 * A known landmark kilometres away has a covariance of kilometres along its ray and metres across it.
 * Brought into the camera in float32, the first drowned the second: a bearing variance came out wrong
 * by its own size, or negative, and the filter took it in.
 */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "math/packed.h"
#include "state/covariance.h"
#include "support/random.h"
#include "support/rig.h"

#define BEARING_SIGMA 2e-4 /* rad: a map of many sightings */

void setUp(void) {
    rig_set_up();
    rig.config.start_sigma = 1e-6; /* the pose adds nothing */
    rig_begin();
}

/* A direction oblique to all axes. */
static void draw_direction(rng *chance, double mu[3]) {
    double length2;
    do {
        rng_normals(chance, 1, mu, 3);
        length2 = mu[0] * mu[0] + mu[1] * mu[1] + mu[2] * mu[2];
        for (int i = 0; i < 3; i++)
            mu[i] /= sqrt(length2);
    } while (fabs(mu[0]) < 0.1 || fabs(mu[1]) < 0.1 || fabs(mu[2]) < 0.1);
}

/* Seen from the camera of a body at identity: P = across^2 (I - mu mu^T) + (range / 2)^2 mu mu^T. */
static plr_landmark far_landmark(rng *chance, double range_m, double across2) {
    const plr_pose *T = &rig.world.calibration.T_CB;
    const double along2 = 0.25 * range_m * range_m;
    plr_landmark landmark;
    double mu[3];
    memset(&landmark, 0, sizeof landmark);
    landmark.id = 7;
    draw_direction(chance, mu);
    for (int i = 0; i < 3; i++) {
        landmark.p_W_m[i] = range_m * mu[i];
        for (int j = 0; j < 3; j++) {
            landmark.p_W_m[i] -= T->R[3 * j + i] * T->p[j];
            landmark.P_W_m2[3 * i + j] =
                (i == j ? across2 : 0) + (along2 - across2) * mu[i] * mu[j];
        }
    }
    return landmark;
}

static void test_its_bearing_is_known_as_well_as_it_was(void) {
    static const double ranges_m[] = {100, 1000, 3000, 10000};
    rng chance = rng_seeded(3);
    for (unsigned n = 0; n < 400; n++) {
        const double range_m = ranges_m[n % 4];
        const double across2 = pow(BEARING_SIGMA * range_m, 2);
        const plr_landmark known = far_landmark(&chance, range_m, across2);
        rig_begin();
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_insert_known(&rig.filter, &known));
        const unsigned row = plr_covariance_row(&rig.filter.belief, 0);
        const double due = BEARING_SIGMA * BEARING_SIGMA;
        for (unsigned i = row; i < row + 2; i++)
            TEST_ASSERT_DOUBLE_WITHIN(0.005 * due, due,
                                      (double)rig.filter.belief.P[plr_packed_at(i, i)]);
    }
}

/* All three variances are positive, and one across the ray is not: of the kind that a float32 filter
 * hands out for a landmark so far away. */
static void test_one_that_is_no_covariance_across_its_ray_is_refused(void) {
    rng chance = rng_seeded(4);
    for (unsigned n = 0; n < 50; n++) {
        const plr_landmark known = far_landmark(&chance, 3000, -50);
        for (int i = 0; i < 9; i += 4)
            TEST_ASSERT_TRUE(known.P_W_m2[i] > 0);
        rig_begin();
        rig_remember();
        rig_demand_untouched(PLR_E_ARGUMENT, plr_filter_insert_known(&rig.filter, &known));
    }
}
