// SPDX-License-Identifier: MIT
/* The body does not move: v = 0 with sigma[0], m/s, and w = 0 with sigma[1], rad/s, each if `axes`
 * has its bit. */
#include <string.h>

#include "sensor/sensor.h"
#include "sensor/stereo.h"
#include "state/slots.h"

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

const plr_sensor_kind plr_standstill = {.of_twist = measure, .place = 1};

/* The squared distance of a landmark's pixels from those that it was anchored at, in their
 * noise. */
static plr_real moved2(const plr_filter *f, const plr_slot *slot, const plr_real z[PLR_ROWS]) {
    plr_real sum = 0;
    for (unsigned i = 0; i < PLR_ROWS; i++) {
        const plr_real step = z[i] - slot->anchor[i];
        sum += step * step / (PLR_R(2) * plr_stereo_variance(f, i));
    }
    return sum;
}

static void anchor(plr_slot *slot, const plr_real z[PLR_ROWS]) {
    memcpy(slot->anchor, z, sizeof slot->anchor);
    slot->anchored = 1;
}

/* True if the pixels of all landmarks together have not moved from their anchors. A landmark
 * without an anchor gets one. */
static bool is_still(plr_filter *f, const plr_frame *frame, unsigned n) {
    plr_real distance2 = 0;
    unsigned rows = 0;
    for (unsigned k = 0; k < n; k++) {
        plr_real z[PLR_ROWS];
        if (f->work.slot_of[k] == PLR_NO_SLOT)
            continue;
        plr_slot *slot = &f->slots[f->work.slot_of[k]];
        plr_stereo_rows(z, &frame->observations[f->work.order[k]]);
        if (!slot->anchored) {
            anchor(slot, z);
            continue;
        }
        distance2 += moved2(f, slot, z);
        rows += PLR_ROWS;
    }
    const plr_real mean = (plr_real)rows;
    return rows >= MIN_ROWS && distance2 <= mean + SIGMAS * PLR_SQRT(PLR_R(2) * mean);
}

static void anchor_all(plr_filter *f, const plr_frame *frame, unsigned n) {
    for (unsigned slot = 0; slot < f->count; slot++)
        f->slots[slot].anchored = 0;
    for (unsigned k = 0; k < n; k++) {
        plr_real z[PLR_ROWS];
        if (f->work.slot_of[k] == PLR_NO_SLOT)
            continue;
        plr_stereo_rows(z, &frame->observations[f->work.order[k]]);
        anchor(&f->slots[f->work.slot_of[k]], z);
    }
}

bool plr_standstill_is_seen(plr_filter *f, const plr_frame *frame, unsigned n,
                            plr_reading *reading) {
    if (f->config.standstill_sigma_mps <= 0)
        return false;
    if (!is_still(f, frame, n)) {
        anchor_all(f, frame, n);
        f->still_since_ns = f->t_ns;
        return false;
    }
    memset(reading, 0, sizeof *reading);
    reading->t_ns = f->t_ns;
    reading->sensor = PLR_SENSOR_STANDSTILL;
    reading->axes = 3;
    reading->sigma[0] = reading->sigma[1] = f->config.standstill_sigma_mps;
    return f->t_ns - f->still_since_ns >= STILL_NS;
}
