// SPDX-License-Identifier: MIT
/* Does the filter know how wrong it is? Normalised squared errors of the pose over simulated drives,
 * against chi-square: `body` within the bounds, `world` (which believes more than it knows) not. */
#include <unity.h>

#include "support/axes.h"
#include "support/chi_square.h"
#include "support/rig.h"

/* In the short form fewer drives, and with them wider bounds; not in float64, where `world` must fail. */
enum { RUNS = PELORUS_SHORT_FORM && PLR_REAL == 32 ? 4 : 20, FRAMES = 150, DOF = 6 };

void setUp(void) {
    rig_set_up();
}

/* Mean squared error per degree of freedom at the end of a drive, over seeds. */
static double mean_squared_error(plr_model_kind model, bool bias) {
    double sum = 0, e[6];
    rig.config.model = (uint8_t)model;
    rig.config.bias = bias;
    rig.config.pixel_sigma_px = rig.options.pixel_sigma_px;
    each_axis(rig.config.velocity_sigma, rig.options.velocity_sigma_mps);
    each_axis(rig.config.gyro_sigma, rig.options.gyro_sigma_radps);
    rig.config.gate_d2 = 25; /* wide: what it cuts off is missing in the errors */
    rig.options.landmarks = 300;
    rig.options.most_seen = 20;
    for (uint64_t seed = 1; seed <= RUNS; seed++) {
        rng chance = rng_seeded(seed + 1000);
        rig.options.seed = seed;
        rng_normals(&chance, bias ? rig.config.bias_velocity_sigma_mps : 0, rig.options.bias, 3);
        rng_normals(&chance, bias ? rig.config.bias_gyro_sigma_radps : 0, rig.options.bias + 3, 3);
        rig_begin();
        rig_drive(FRAMES);
        sum += rig_squared_error(e);
    }
    return sum / (DOF * RUNS);
}

static void test_body_knows_how_wrong_it_is(void) {
    chi_square_demand("body", mean_squared_error(PLR_MODEL_BODY, false), RUNS * DOF);
}

static void test_body_with_biases_knows_how_wrong_it_is(void) {
    chi_square_demand("body", mean_squared_error(PLR_MODEL_BODY, true), RUNS * DOF);
}

static void test_world_believes_more_than_it_knows(void) {
    double low, high;
    if (PLR_REAL == 32)
        TEST_IGNORE_MESSAGE("world is not for float32: docs/NUMERICS.md");
    chi_square_bounds(RUNS * DOF, &low, &high);
    TEST_ASSERT_GREATER_THAN_DOUBLE(1.2 * high, mean_squared_error(PLR_MODEL_WORLD, false));
}
