// SPDX-License-Identifier: MIT
#include "support/pictures.h"

#include <math.h>
#include <string.h>

#define TWO_PI 6.283185307179586

texture texture_of(uint64_t seed) {
    texture t;
    rng chance = rng_seeded(seed);
    double sum2 = 0;
    for (int i = 0; i < TEXTURE_WAVES; i++) {
        const double angle = rng_uniform(&chance, 0, TWO_PI);
        const double length = 7 * pow(50.0 / 7, rng_uniform(&chance, 0, 1));
        t.kx[i] = TWO_PI / length * cos(angle);
        t.ky[i] = TWO_PI / length * sin(angle);
        t.phase[i] = rng_uniform(&chance, 0, TWO_PI);
        t.share[i] = length;
        sum2 += length * length / 2;
    }
    for (int i = 0; i < TEXTURE_WAVES; i++)
        t.share[i] /= sqrt(sum2);
    return t;
}

double texture_at(const texture *t, double x, double y) {
    double sum = 0;
    for (int i = 0; i < TEXTURE_WAVES; i++)
        sum += t->share[i] * sin(t->kx[i] * x + t->ky[i] * y + t->phase[i]);
    return sum;
}

view view_at(double x, double y) {
    const view how = {{x, y}, {1, 0, 0, 1}, 40, 128, 0};
    return how;
}

void render(uint8_t *pixels, unsigned width, unsigned height, unsigned stride, const texture *t,
            const view *how, rng *chance) {
    for (unsigned v = 0; v < height; v++)
        for (unsigned u = 0; u < width; u++) {
            const double x = how->at[0] + how->A[0] * u + how->A[1] * v;
            const double y = how->at[1] + how->A[2] * u + how->A[3] * v;
            double grey = how->gain * texture_at(t, x, y) + how->offset;
            if (how->noise > 0)
                grey += how->noise * rng_normal(chance);
            pixels[v * stride + u] = (uint8_t)lround(fmin(fmax(grey, 0), 255));
        }
}

plr_rig rectified_rig(unsigned width, unsigned height) {
    plr_rig rig;
    memset(&rig, 0, sizeof rig);
    rig.left.width_px = (uint16_t)width, rig.left.height_px = (uint16_t)height;
    rig.left.fx_px = rig.left.fy_px = width;
    rig.left.cx_px = (width - 1) / 2.0, rig.left.cy_px = (height - 1) / 2.0;
    rig.right = rig.left;
    rig.T_RL.R[0] = rig.T_RL.R[4] = rig.T_RL.R[8] = 1;
    rig.T_RL.p[0] = -0.1;
    return rig;
}
