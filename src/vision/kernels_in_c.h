// SPDX-License-Identifier: MIT
/* Included by kernels.c. */
#ifndef PLR_VISION_KERNELS_IN_C_H
#define PLR_VISION_KERNELS_IN_C_H

void plr_patch_sample(const plr_image *image, int32_t x, int32_t y,
                      uint8_t patch[PLR_PATCH_BYTES]) {
    plr_patch_sample_plain(image, x, y, patch);
}

void plr_template_fill(plr_template *t, const uint8_t patch[PLR_PATCH_BYTES],
                       plr_template_sums *s) {
    plr_template_fill_plain(t, patch, s);
}

void plr_patch_sum(plr_patch_sums *s, const plr_image *image, const plr_grid *g,
                   const plr_template *t) {
    plr_patch_sum_plain(s, image, g, t);
}

void plr_pyramid_halve(const plr_image *in, uint8_t *out) {
    plr_pyramid_halve_plain(in, out);
}

#endif
