// SPDX-License-Identifier: MIT
#include "sensor/sensor.h"

#include <stddef.h>

/* By plr_sensor. */
static const plr_sensor_kind *const kinds[PLR_SENSORS] = {
    [PLR_SENSOR_WHEEL - 1] = &plr_wheel,
    [PLR_SENSOR_STANDSTILL - 1] = &plr_standstill,
    [PLR_SENSOR_POSITION - 1] = &plr_position,
};

const plr_sensor_kind *plr_sensor_of(unsigned sensor) {
    return sensor >= 1 && sensor <= PLR_SENSORS ? kinds[sensor - 1] : NULL;
}
