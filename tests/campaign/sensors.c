// SPDX-License-Identifier: MIT
#include "campaign/sensors.h"

#include <math.h>
#include <string.h>

/* Readings of a camera in the dark: nothing like the truth, and within what a step may hold. */
static const double GARBAGE_MPS = 3, GARBAGE_RADPS = 0.5;

void sensors_begin(sensors *e, const scenario *s, const plr_config *config, uint64_t seed) {
    memset(e, 0, sizeof *e);
    e->s = s;
    e->twist_chance = chance_seeded(seed, 2);
    e->pixel_chance = chance_seeded(seed, 3);
    e->match_chance = chance_seeded(seed, 5);
    if (!s->bias)
        return;
    chance c = chance_seeded(seed, 4);
    for (int i = 0; i < 6; i++)
        e->bias[i] = chance_normal(&c) *
                     (i < 3 ? config->bias_velocity_sigma_mps : config->bias_gyro_sigma_radps);
    e->bias_walk[0] = config->bias_velocity_walk;
    e->bias_walk[1] = config->bias_gyro_walk;
}

plr_twist sensors_read(sensors *e, const world *w, bool event) {
    const mishap what = event ? e->s->mishap : NOTHING;
    const double factor = what == SLIP ? e->s->strength : 1;
    const double rate_factor = what == GYRO_SCALE ? e->s->strength : factor;
    plr_twist u;
    for (int i = 0; i < 3; i++) {
        double *bias_w = e->bias + 3 + i, *bias_v = e->bias + i;
        u.v_B_mps[i] = factor * w->twist.v_B_mps[i] + *bias_v +
                       e->s->velocity_mps * chance_normal(&e->twist_chance);
        u.w_B_radps[i] = rate_factor * w->twist.w_B_radps[i] + *bias_w +
                         e->s->gyro_radps * chance_normal(&e->twist_chance);
        if (what == DEAD_WHEELS || what == DEAD_TWISTS)
            u.v_B_mps[i] = 0;
        if (what == DEAD_TWISTS || what == DEAD_GYRO)
            u.w_B_radps[i] = 0;
        if (what == BLIND) {
            u.v_B_mps[i] = GARBAGE_MPS * chance_normal(&e->twist_chance);
            u.w_B_radps[i] = GARBAGE_RADPS * chance_normal(&e->twist_chance);
        }
        if (e->s->bias) {
            *bias_v += sqrt(e->bias_walk[0] * w->step_s) * chance_normal(&e->twist_chance);
            *bias_w += sqrt(e->bias_walk[1] * w->step_s) * chance_normal(&e->twist_chance);
        }
    }
    return u;
}

static unsigned most_seen(const sensors *e, bool event) {
    if (event && e->s->mishap == BLIND)
        return 0;
    return e->s->few && e->frames > FRAME_HZ ? e->frames % 3 : e->s->landmarks;
}

/* Of two wrong matches one shows another point, and one has another point in the right picture alone. */
static void mismatch(sensors *e, const world *w, double z[4]) {
    const plr_calibration *c = &w->calibration;
    const double depth = chance_uniform(&e->match_chance, e->s->near_m, e->s->far_m);
    if (chance_uniform(&e->match_chance, 0, 1) < 0.5) {
        z[0] = chance_uniform(&e->match_chance, 0, WIDTH_PX);
        z[1] = z[3] = chance_uniform(&e->match_chance, 0, HEIGHT_PX);
    }
    z[2] = z[0] - c->fx_px * c->baseline_m / depth;
}

void sensors_look(sensors *e, const world *w, bool event) {
    e->frames++;
    if (event && e->s->mishap == FROZEN)
        return;
    const unsigned most = most_seen(e, event);
    e->count = 0;
    for (unsigned k = 0; k < e->s->landmarks && e->count < most; k++) {
        double z[4];
        if (!world_project(w, &w->points[k], z))
            continue;
        if (chance_uniform(&e->match_chance, 0, 1) < e->s->wrong_matches)
            mismatch(e, w, z);
        for (int i = 0; i < 4; i++)
            z[i] += w->points[k].drift_px[i % 2] + e->s->pixel_px * chance_normal(&e->pixel_chance);
        e->seen[e->count++] = (plr_observation){w->points[k].id, (float)z[0], (float)z[1],
                                                (float)z[2],     (float)z[3], 0};
    }
}
