// SPDX-License-Identifier: MIT
#include "sensor/sensor.h"

#include <stddef.h>

#define SENSOR(number, kind, about) [(number)-1] = &(kind),
static const plr_sensor_kind *const kinds[PLR_SENSORS] = {
#include "sensor/sensors.def"
};
#undef SENSOR

const plr_sensor_kind *plr_sensor_of(unsigned sensor) {
    return sensor >= 1 && sensor <= PLR_SENSORS ? kinds[sensor - 1] : NULL;
}
