// SPDX-License-Identifier: MIT
#include "process/wheels.h"

#include <string.h>

#include "limits/limits.h"
#include "math/small.h"
#include "pelorus/assertions.h"
#include "state/calibration.h"
#include "state/seconds.h"

/* A standstill is told so often. */
#define REST_EVERY_NS UINT64_C(100000000)

static bool measures(const plr_reading *reading, unsigned axis) {
    return (reading->axes >> axis & 1) != 0;
}

/* ---------------------------------------------------------------- where they are, and whether they stand */

/* Its number; count: it is not known. */
static unsigned number_of(const plr_wheels *wheels, const plr_real at_B[3]) {
    unsigned k = 0;
    for (; k < wheels->count; k++) {
        const plr_real *own = wheels->at_B + 3 * k;
        const plr_real off[3] = {own[0] - at_B[0], own[1] - at_B[1], own[2] - at_B[2]};
        if (!(plr_dot3(off, off) > 0))
            break;
    }
    return k;
}

static bool is_silent(const plr_source *source, unsigned k, plr_time_ns t_ns) {
    const plr_wheels *wheels = &source->wheels;
    return t_ns < wheels->t_ns[k] ||
           t_ns - wheels->t_ns[k] > plr_limit_ns(source->left_out, PLR_LIMIT_WHEEL_REST_MS);
}

void plr_wheels_note(plr_source *source, const plr_reading *reading) {
    plr_wheels *wheels = &source->wheels;
    const plr_real at_B[3] = {(plr_real)reading->at_B_m[0], (plr_real)reading->at_B_m[1],
                              (plr_real)reading->at_B_m[2]};
    const unsigned k = number_of(wheels, at_B);
    PLR_ASSERT(wheels->count <= PLR_WHEELS);
    wheels->latest = (uint8_t)k;
    if (k == PLR_WHEELS)
        return;
    bool moves = k == wheels->count || is_silent(source, k, reading->t_ns);
    if (k == wheels->count) {
        memcpy(wheels->at_B + 3 * k, at_B, sizeof at_B);
        wheels->count++;
    }
    for (unsigned i = 0; i < PLR_ROWS; i++)
        moves = moves || (measures(reading, i) && reading->value[i] * reading->value[i] > 0);
    wheels->interval_ns[k] = reading->t_ns >= wheels->t_ns[k] ? reading->t_ns - wheels->t_ns[k] : 0;
    wheels->t_ns[k] = reading->t_ns;
    if (moves)
        wheels->moved_ns[k] = reading->t_ns;
}

bool plr_wheels_hold(plr_source *source, const plr_real r[PLR_ROWS], bool passed) {
    plr_wheels *wheels = &source->wheels;
    const unsigned k = wheels->latest;
    if (k >= wheels->count)
        return passed;
    const plr_time_ns now = wheels->t_ns[k], since = wheels->slip_ns[k];
    plr_real *slip = wheels->slip + 3 * k, off[3], next2 = 0;
    const plr_time_ns readings = plr_limit_count(source->left_out, PLR_LIMIT_SLIP_READINGS);
    const plr_time_ns longest = plr_limit_ns(source->left_out, PLR_LIMIT_SLIP_MS);
    const bool slips = since > 0 && since <= now;
    for (unsigned i = 0; i < PLR_ROWS; i++) {
        off[i] = slips ? r[i] - slip[i] : r[i];
        next2 = PLR_FMA(off[i], off[i], next2);
    }
    const bool confirmed = slips && now - since >= readings * wheels->interval_ns[k];
    if (passed && !(confirmed && now - since < longest && plr_dot3(r, r) >= next2)) {
        wheels->slip_ns[k] = 0;
        return true;
    }
    const plr_real share = plr_seconds(wheels->interval_ns[k]) /
                           plr_seconds(plr_limit_ns(source->left_out, PLR_LIMIT_SLIP_FOLLOWED_MS));
    for (unsigned i = 0; i < PLR_ROWS; i++)
        slip[i] = slips && share < 1 ? PLR_FMA(share, off[i], slip[i]) : r[i];
    if (!slips)
        wheels->slip_ns[k] = now;
    return false;
}

bool plr_wheels_stand(plr_source *source, plr_time_ns t_ns) {
    plr_wheels *wheels = &source->wheels;
    unsigned stand = 0;
    for (unsigned k = 0; k < wheels->count; k++) {
        if (is_silent(source, k, t_ns))
            continue;
        if (t_ns - wheels->moved_ns[k] < plr_limit_ns(source->left_out, PLR_LIMIT_WHEEL_REST_MS))
            return false;
        stand++;
    }
    const bool told = t_ns >= wheels->rest_ns && t_ns - wheels->rest_ns < REST_EVERY_NS;
    if (stand == 0 || told)
        return false;
    wheels->rest_ns = t_ns;
    return true;
}

/* ---------------------------------------------------------------- what they read */

void plr_wheels_deny_slide(plr_reading *reading, double sigma_mps) {
    for (unsigned i = 0; i < PLR_ROWS && sigma_mps > 0; i++) {
        if (measures(reading, i))
            continue;
        reading->axes |= (uint8_t)(1U << i);
        reading->value[i] = 0;
        reading->sigma[i] = sigma_mps;
    }
}

/* From the middle of all wheels to a place; zero where there is only one. */
static void from_middle(const plr_wheels *wheels, const plr_real at_B[3], plr_real arm[3]) {
    memset(arm, 0, 3 * sizeof *arm);
    for (unsigned i = 0; i < 3 && wheels->count > 1; i++) {
        plr_real sum = 0;
        for (unsigned k = 0; k < wheels->count; k++)
            sum += wheels->at_B[3 * k + i];
        arm[i] = at_B[i] - sum / (plr_real)wheels->count;
    }
}

void plr_wheels_correct(const plr_source *source, const plr_camera_model *camera,
                        plr_reading *reading) {
    const double scale = (double)plr_calibration_moved(camera, PLR_WHEEL_SCALE);
    const double track = (double)plr_calibration_moved(camera, PLR_WHEEL_TRACK);
    plr_real at_B[3], arm[3];
    for (unsigned i = 0; i < 3; i++)
        at_B[i] = (plr_real)reading->at_B_m[i];
    from_middle(&source->wheels, at_B, arm);
    for (unsigned i = 0; i < 3; i++) {
        reading->value[i] += scale * reading->value[i];
        reading->at_B_m[i] += track * (double)arm[i];
    }
}

/* The true velocity is (1 + s) z. As z is noisy, the predicted M u = z - r stands in its place. A wheel that
 * sits farther from the middle by the share s adds s w x arm. Its w is the smoothed rate: the noise of a single
 * reading's is in r, too, and would correlate the two. */
void plr_wheels_differentiate(const plr_belief *belief, const plr_source *source,
                              const plr_camera_model *camera, const plr_reading *reading,
                              uint8_t measured, const plr_real z[PLR_ROWS],
                              const plr_real r[PLR_ROWS], plr_by_wheel *by) {
    plr_real at_B[3], arm[3], w[3], turning[3];
    for (unsigned i = 0; i < 3; i++) {
        at_B[i] = (plr_real)reading->at_B_m[i];
        w[i] = camera->estimate.rate[i] - belief->bias[3 + i];
    }
    from_middle(&source->wheels, at_B, arm);
    plr_cross3(turning, w, arm);
    for (unsigned i = 0; i < PLR_ROWS; i++) {
        const bool own = (measured >> i & 1) != 0;
        by->error[0][i] = own ? r[i] - z[i] : PLR_R(0);
        by->error[1][i] = own ? turning[i] : PLR_R(0);
    }
}
