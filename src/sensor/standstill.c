// SPDX-License-Identifier: MIT
/* The body rests: v = 0 with sigma[0], m/s, w = 0 with sigma[1], rad/s, each if in `axes`. */
#include "sensor/standstill.h"

#include <string.h>

#include "sensor/sensor.h"
#include "sensor/stereo.h"
#include "state/seconds.h"
#include "state/sightings.h"

enum { MIN_ROWS = 15 }; /* with fewer rows of pixels a standstill is not recognised */

/* Time without a movement before a standstill is reported. */
#define STILL_NS UINT64_C(1000000000)
/* The limit on chi-square: its mean plus this many of its standard deviations. */
#define SIGMAS PLR_R(3)

static unsigned measure(const plr_reading *reading, plr_twist_rows rows[2]) {
    memset(rows, 0, 2 * sizeof *rows);
    for (unsigned part = 0; part < 2; part++)
        for (unsigned i = 0; i < PLR_ROWS; i++) {
            const bool measured = plr_reading_has(reading, part);
            rows[part].R[i] =
                measured ? (plr_real)(reading->sigma[part] * reading->sigma[part]) : PLR_R(1);
            rows[part].M[PLR_POSE_DIM * i + 3 * part + i] = measured ? PLR_R(1) : PLR_R(0);
        }
    return 2;
}

const plr_sensor_kind plr_standstill = {
    .of_twist = measure, .place = 1, .axes = 3, .most_value = 0};

/* The squared distance of a landmark's pixels from those that it was anchored at, in their noise
 * and in what its track has wandered since. */
static plr_real moved2(const plr_belief *belief, const plr_camera_model *camera,
                       const plr_slot *slot, const plr_real z[PLR_ROWS]) {
    const plr_real since = plr_seconds(belief->t_ns - slot->anchor_ns);
    const plr_real drift = camera->track_drift_variance * since;
    plr_real sum = 0;
    for (unsigned i = 0; i < PLR_ROWS; i++) {
        const plr_real step = z[i] - slot->anchor[i];
        sum += step * step / (PLR_R(2) * plr_stereo_variance(camera, i) + drift);
    }
    return sum;
}

static void anchor(const plr_belief *belief, plr_slot *slot, const plr_real z[PLR_ROWS]) {
    memcpy(slot->anchor, z, sizeof slot->anchor);
    slot->anchor_ns = belief->t_ns;
    slot->anchored = 1;
}

/* Compares the pixels of the landmarks with their anchors, and anchors those that have none.
 * Returns whether together they have not moved; *old_rows receives the rows with an anchor of a
 * second ago and more, which alone show that a slow body stands. */
static bool is_still(plr_belief *belief, const plr_camera_model *camera,
                     const plr_sightings *sightings, unsigned *old_rows) {
    plr_real distance2 = 0;
    *old_rows = 0;
    for (unsigned k = 0; k < sightings->count; k++) {
        const plr_sighting *s = &sightings->at[k];
        plr_real z[PLR_ROWS];
        if (!plr_is_matched(s))
            continue;
        plr_slot *slot = plr_slot_of(belief, s);
        plr_stereo_rows(z, s->seen);
        if (!slot->anchored) {
            anchor(belief, slot, z);
        } else if (belief->t_ns - slot->anchor_ns >= STILL_NS) {
            distance2 += moved2(belief, camera, slot, z);
            *old_rows += PLR_ROWS;
        }
    }
    const plr_real mean = (plr_real)*old_rows;
    return distance2 <= mean + SIGMAS * PLR_SQRT(PLR_R(2) * mean);
}

bool plr_standstill_is_seen(plr_belief *belief, const plr_camera_model *camera,
                            const plr_sightings *sightings, double sigma_mps,
                            plr_reading *reading) {
    unsigned old_rows;
    if (sigma_mps <= 0)
        return false;
    if (!is_still(belief, camera, sightings, &old_rows)) {
        for (unsigned slot = 0; slot < belief->count; slot++)
            belief->slots[slot].anchored = 0;
        return false;
    }
    memset(reading, 0, sizeof *reading);
    reading->t_ns = belief->t_ns;
    reading->sensor = PLR_SENSOR_STANDSTILL;
    reading->axes = 3;
    reading->sigma[0] = reading->sigma[1] = sigma_mps;
    return old_rows >= MIN_ROWS;
}
