// SPDX-License-Identifier: MIT
/*
 * Patches, and finding them again: inverse composition (Baker and Matthews 2004) with gain and offset.
 *
 * A patch is 9 x 9 px, kept as bytes with a margin of one. Its template T has grey levels times 16 and
 * central differences J. A place p in a picture shows the patch through A, 2x2: sample I(o) at p + A o. With
 * means taken off (~), residuals are r = g I~ - T~, g = |T~| / |I~|; the step d = (J~^T J~)^-1 J~^T r leads
 * from p to p - A d. Sums over the 81 samples are integers, and exact.
 *
 * Central differences are not the slope of a sharp edge: steps would be too long or too short, each by the
 * same share, and swing. Two of them in succession tell the share (Irons and Tuck 1969).
 */
#ifndef PLR_VISION_PATCH_H
#define PLR_VISION_PATCH_H

#include <stdbool.h>
#include <stdint.h>

#include "pelorus/config.h"
#include "pelorus/vision.h"
#include "vision/pyramid.h"

enum { PLR_SAMPLES = PLR_PATCH_SIDE * PLR_PATCH_SIDE, PLR_GREY = 16 };

/* A patch prepared for a fit. */
typedef struct plr_template {
    int16_t T[PLR_SAMPLES], Jx[PLR_SAMPLES], Jy[PLR_SAMPLES];
    int32_t sum_T, sum_Jx, sum_Jy;
    plr_real TT, JxT, JyT; /* of T~ */
    plr_real H[3];         /* J~^T J~: xx xy yy */
} plr_template;

/* What a step needs of the 81 samples. */
typedef struct plr_patch_sums {
    int32_t I, II, IT, IJx, IJy;
} plr_patch_sums;

/* Samples of a picture: place and A in 1/65536 px. */
typedef struct plr_grid {
    int32_t x, y, A[4];
} plr_grid;

/* What came of a fit. */
typedef struct plr_fit {
    plr_real at[2];    /* in the level's own px */
    plr_real cov[3];   /* of it, xx xy yy, from residuals and contrast */
    plr_real likeness; /* normalised correlation */
    uint16_t steps;
    bool inside; /* false: the patch left the picture */
    bool ended;  /* by a small step */
} plr_fit;

/* Cuts the patch around `at`, in the level's px, of 11 x 11. False outside. */
bool plr_patch_cut(const plr_image *image, const plr_real at[2], uint8_t patch[PLR_PATCH_BYTES]);

/* Prepares a patch. False where it has no contrast in some direction. */
bool plr_template_make(plr_template *t, const uint8_t patch[PLR_PATCH_BYTES]);

/* The place of a patch, from its middle, about which it can grow or shrink without moving what a fit finds:
 * J~^T J~ c = J~^T (J o)~. */
void plr_template_centre(const plr_template *t, plr_real centre[2]);

/* How a surface lies, from what is left over where a fit has ended: the change of its slope, such that
 * samples move by c (slope o), in the patch's px; `info` is the inverse of its covariance, xx xy yy. */
bool plr_patch_slope(const plr_image *image, const plr_template *t, const plr_real at[2],
                     const plr_real A[4], const plr_real c[2], plr_real change[2],
                     plr_real info[3]);

/* The grid of a place; false where a sample, or what it is interpolated from, lies outside. */
bool plr_grid_place(plr_grid *g, const plr_image *image, const plr_real at[2], const plr_real A[4]);

/* Sums over the 81 samples, bilinear with weights of 6 bits. */
void plr_patch_sum(plr_patch_sums *s, const plr_image *image, const plr_grid *g,
                   const plr_template *t);

/* Normalised correlation at a place; -1 outside. */
plr_real plr_patch_likeness(const plr_image *image, const plr_template *t, const plr_real at[2],
                            const plr_real A[4]);

/* Steps from fit->at on, at most so many. */
void plr_patch_fit(plr_fit *fit, const plr_image *image, const plr_template *t, const plr_real A[4],
                   unsigned most_steps);

#endif
