// SPDX-License-Identifier: MIT
#include "support/small_sensors.h"

#include <string.h>
#include <unity.h>

#include "support/axes.h"
#include "support/rig.h"
#include "support/rigid.h"

static const double arm[3] = {0.4, -0.3, 0.2};

rng small_sensors_chance;

void small_sensors_set_up(void) {
    rig_set_up();
    rig.options.landmarks = 300;
    rig.options.most_seen = 20;
    rig.options.velocity_sigma_mps = 0.2;
    rig.options.gyro_sigma_radps = 0.02;
    rig.config.pixel_sigma_px = rig.options.pixel_sigma_px;
    each_axis(rig.config.velocity_sigma, rig.options.velocity_sigma_mps);
    each_axis(rig.config.gyro_sigma, rig.options.gyro_sigma_radps);
    rig.config.bias_velocity_sigma_mps = 0.03; /* so that there is something to be found */
    rig.config.bias_gyro_sigma_radps = 0.002;  /* so that dead reckoning stays nearly linear */
    rig.config.gate_d2 = 40;                   /* wide: what it cuts off is missing in the errors */
}

plr_reading reading_of(plr_sensor sensor, uint8_t axes, double sigma) {
    plr_reading reading = {.t_ns = rig.world.t_ns, .sensor = (uint8_t)sensor, .axes = axes};
    each_axis(reading.sigma, sigma);
    if (sensor != PLR_SENSOR_STANDSTILL)
        memcpy(reading.at_B_m, arm, sizeof arm);
    return reading;
}

plr_reading wheel(uint8_t axes, double sigma) {
    plr_reading reading = reading_of(PLR_SENSOR_WHEEL, axes, sigma);
    plr_twist u;
    scene_true_twist(&rig.world, &u);
    const double *w = u.w_B_radps;
    const double turn[3] = {w[1] * arm[2] - w[2] * arm[1], w[2] * arm[0] - w[0] * arm[2],
                            w[0] * arm[1] - w[1] * arm[0]};
    for (int i = 0; i < 3; i++)
        reading.value[i] = u.v_B_mps[i] + turn[i] + sigma * rng_normal(&small_sensors_chance);
    return reading;
}

plr_reading position(uint8_t axes, double sigma) {
    plr_reading reading = reading_of(PLR_SENSOR_POSITION, axes, sigma);
    rigid_apply(reading.value, rig.world.T_WB, arm);
    for (int i = 0; i < 3; i++)
        reading.value[i] += sigma * rng_normal(&small_sensors_chance);
    return reading;
}

void measure(plr_reading reading) {
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_measure(&rig.filter, &reading, NULL));
}
