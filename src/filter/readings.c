// SPDX-License-Identifier: MIT
#include "filter/readings.h"

#include <string.h>

#include "sensor/sensor.h"

enum {
    IN_SUCCESSION = 10, /* rejected readings */
    FULL_SUM = 20       /* readings that the sums look back, 1 / (1 - DECAY) */
};

/* What the sums keep from reading to reading. */
#define DECAY PLR_R(0.95)
/* A reading counts for no more than this many times its numbers, plus this: one wrong one is no
 * sensor that is wrong. */
#define MOST_TIMES PLR_R(3)
#define MOST_PLUS  PLR_R(3)
/* Readings are off as soon as the sum is above the first number of its standard deviations, and until it
 * is below the second. With the noise as stated it stayed below 5.1 in 140 drives of a minute. */
#define OFF_ABOVE PLR_R(6)
#define OFF_BELOW PLR_R(2)

void plr_readings_clear(plr_filter *f) {
    memset(f->readings, 0, sizeof f->readings);
    for (unsigned i = 0; i < PLR_SENSORS; i++)
        f->readings[i].t_ns = PLR_NEVER_NS;
}

static void judge(plr_readings *of, bool used, plr_real d2, plr_real numbers) {
    const plr_real most = PLR_FMA(MOST_TIMES, numbers, MOST_PLUS), full = FULL_SUM * numbers;
    of->rejected = used ? 0 : (uint16_t)(of->rejected + (of->rejected < UINT16_MAX));
    of->excess = PLR_FMA(DECAY, of->excess, (d2 < most ? d2 : most) - numbers);
    of->numbers = PLR_FMA(DECAY, of->numbers, numbers);
    /* the variance of `excess`, 2 n / (1 - DECAY^2), is about `numbers` when that is full */
    const plr_real variance = of->numbers > full ? of->numbers : full;
    const plr_real limit = of->off ? OFF_BELOW : OFF_ABOVE;
    of->off = of->excess > 0 && of->excess * of->excess > limit * limit * variance;
}

void plr_readings_add(plr_filter *f, const plr_reading *reading, bool used, plr_real d2) {
    plr_readings *of = &f->readings[reading->sensor - 1];
    unsigned numbers = 0;
    for (unsigned i = 0; i < 3; i++)
        numbers += plr_reading_has(reading, i);
    if (reading->sensor == PLR_SENSOR_STANDSTILL) /* three of each of its bits */
        numbers *= 3;
    judge(of, used, d2, (plr_real)numbers);
    of->t_ns = reading->t_ns;
    memcpy(of->value, reading->value, sizeof of->value);
}

plr_real plr_readings_widening(const plr_filter *f, unsigned sensor) {
    const plr_readings *of = &f->readings[sensor - 1];
    return of->off ? PLR_R(1) + of->excess / of->numbers : PLR_R(1);
}

bool plr_readings_are_wrong(const plr_filter *f) {
    for (unsigned i = 0; i < PLR_SENSORS; i++)
        if (f->readings[i].rejected >= IN_SUCCESSION || f->readings[i].off)
            return true;
    return false;
}

bool plr_readings_repeats(const plr_filter *f, const plr_reading *reading) {
    const plr_readings *of = &f->readings[reading->sensor - 1];
    return plr_sensor_of(reading->sensor)->of_state && of->t_ns == reading->t_ns &&
           memcmp(of->value, reading->value, sizeof of->value) == 0;
}
