// SPDX-License-Identifier: MIT
#include "supervise/readings.h"

#include "limits/limits.h"
#include "math/leaky.h"
#include "supervise/supervise.h"

/* 1 / (1 - SENSOR_KEEPS): so many readings the sums look back. */
#define FULL_SUM PLR_R(20)

void plr_sensors_add(plr_supervisor *s, const plr_reading *reading, unsigned numbers, bool used,
                     plr_real d2) {
    plr_sensor_record *of = &s->sensors[reading->sensor - 1];
    const plr_real keeps = plr_limit(s->left_out, PLR_LIMIT_SENSOR_KEEPS);
    const plr_real times = plr_limit(s->left_out, PLR_LIMIT_SENSOR_MOST);
    const plr_real n = (plr_real)numbers, most = PLR_FMA(times, n, times);
    of->rejected = used ? 0 : (uint16_t)(of->rejected + (of->rejected < UINT16_MAX));
    of->excess = plr_leaky_sum(of->excess, keeps, (d2 < most ? d2 : most) - n);
    of->numbers = plr_leaky_sum(of->numbers, keeps, n);
    /* the variance of `excess`, 2 n / (1 - keeps^2), is about `numbers` when that is full */
    const plr_real variance = of->numbers > FULL_SUM * n ? of->numbers : FULL_SUM * n;
    const plr_real limit =
        plr_limit(s->left_out, of->off ? PLR_LIMIT_SENSOR_BELOW : PLR_LIMIT_SENSOR_ABOVE);
    of->off = of->excess > 0 && of->excess * of->excess > limit * limit * variance;
    plr_sensors_note(s, reading);
}

plr_real plr_supervise_widening(const plr_supervisor *s, unsigned sensor) {
    const plr_sensor_record *of = &s->sensors[sensor - 1];
    return of->off ? PLR_R(1) + of->excess / of->numbers : PLR_R(1);
}

bool plr_sensors_are_wrong(const plr_supervisor *s) {
    const unsigned most = plr_limit_count(s->left_out, PLR_LIMIT_SENSOR_REJECTED);
    for (unsigned i = 0; i < PLR_SENSORS; i++)
        if (s->sensors[i].rejected >= most || s->sensors[i].off)
            return true;
    return false;
}
