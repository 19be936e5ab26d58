// SPDX-License-Identifier: MIT
/* The pose of the camera from points that are known in the world and seen in stereo, without
 * need of a guess and with wrong ones among them: random samples of three (RANSAC: Fischler and
 * Bolles 1981), then the method of Gauss and Newton in the pixels (docs/MATH.md 13). */
#ifndef PLR_KNOWN_MAP_PLACING_H
#define PLR_KNOWN_MAP_PLACING_H

#include <stdbool.h>

#include "pelorus/camera.h"

enum {
    PLR_PLACING_LEAST = 4, /* points: three tell a pose, the fourth confirms it */
    PLR_PLACING_MOST = 64
};

/* A known point in sight. */
typedef struct plr_seen_known {
    plr_real w[3];   /* in the world, from an origin near it, m */
    plr_real P[9];   /* its covariance, m^2 */
    plr_real z[3];   /* seen: uL, uR, v, px */
    plr_real gap_d2; /* of vL and vR, which no pose explains */
    uint16_t k;      /* row of the frame */
    bool agrees;     /* with the pose at hand */
} plr_seen_known;

/* q = R w + t: from the world to the left camera. */
typedef struct plr_placing {
    plr_real R[9], t[3];
    plr_real P_C[PLR_POSE_SQUARE]; /* covariance of (rho, theta): q is rho + Exp(theta) (R w + t) */
} plr_placing;

/* The pose with which most points agree, and those are marked. Returns how many, or 0 if they
 * are fewer than PLR_PLACING_LEAST. At most PLR_PLACING_MOST points. `guess`: a pose (R, t) to
 * begin with, or NULL: with one it needs no near points. */
unsigned plr_place(const plr_camera_model *camera, plr_seen_known *seen, unsigned count,
                   const plr_placing *guess, plr_placing *placing);

/* The pose that is likeliest by the points and by `prior`, a pose with its covariance P_C: for
 * any number of points, of which those that agree with it are marked. Returns how many.
 * placing->P_C is not filled. */
unsigned plr_place_by_prior(const plr_camera_model *camera, plr_seen_known *seen, unsigned count,
                            const plr_placing *prior, plr_placing *placing);

#endif
