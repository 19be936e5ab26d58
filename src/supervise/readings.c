// SPDX-License-Identifier: MIT
#include "supervise/readings.h"

#include "math/leaky.h"
#include "supervise/limits.h"
#include "supervise/supervise.h"

/* What the sums keep from reading to reading; they look back 1 / (1 - KEEPS) of them. */
#define KEEPS    PLR_R(0.95)
#define FULL_SUM PLR_R(20)
/* A reading counts for no more than this many times its numbers, plus this: one wrong one is no sensor that
 * is wrong. */
#define MOST_TIMES PLR_R(3)
#define MOST_PLUS  PLR_R(3)

void plr_sensors_add(plr_supervisor *s, const plr_reading *reading, unsigned numbers, bool used,
                     plr_real d2) {
    plr_sensor_record *of = &s->sensors[reading->sensor - 1];
    const plr_real n = (plr_real)numbers, most = PLR_FMA(MOST_TIMES, n, MOST_PLUS);
    of->rejected = used ? 0 : (uint16_t)(of->rejected + (of->rejected < UINT16_MAX));
    of->excess = plr_leaky_sum(of->excess, KEEPS, (d2 < most ? d2 : most) - n);
    of->numbers = plr_leaky_sum(of->numbers, KEEPS, n);
    /* the variance of `excess`, 2 n / (1 - KEEPS^2), is about `numbers` when that is full */
    const plr_real variance = of->numbers > FULL_SUM * n ? of->numbers : FULL_SUM * n;
    const plr_real limit = plr_limit(s, of->off ? PLR_LIMIT_SENSOR_BELOW : PLR_LIMIT_SENSOR_ABOVE);
    of->off = of->excess > 0 && of->excess * of->excess > limit * limit * variance;
    plr_sensors_note(s, reading);
}

plr_real plr_supervise_widening(const plr_supervisor *s, unsigned sensor) {
    const plr_sensor_record *of = &s->sensors[sensor - 1];
    return of->off ? PLR_R(1) + of->excess / of->numbers : PLR_R(1);
}

bool plr_sensors_are_wrong(const plr_supervisor *s) {
    const unsigned most = plr_limit_count(s, PLR_LIMIT_SENSOR_REJECTED);
    for (unsigned i = 0; i < PLR_SENSORS; i++)
        if (s->sensors[i].rejected >= most || s->sensors[i].off)
            return true;
    return false;
}
