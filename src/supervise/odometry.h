// SPDX-License-Identifier: MIT
/*
 * Pictures against odometry. Each frame yields nu, the difference between the motion that the pictures
 * show and the odometry's, in the odometry's sigmas. Its sum over frames must look like noise, in units of
 * what is usual on this drive. Where it does not, though it did before, the odometry loses weight until it
 * does again (docs/SUPERVISION.md).
 */
#ifndef PLR_SUPERVISE_ODOMETRY_H
#define PLR_SUPERVISE_ODOMETRY_H

#include "pelorus/supervisor.h"

/* What a frame has shown. */
typedef struct plr_odometry_verdict {
    bool contradicts; /* from this frame on, or in this frame by itself, and in earnest */
    bool departs;     /* the sum exceeds what is usual, and did not always do so */
    plr_real excess;  /* chi-square of a frame that contradicts by itself, else 0 */
} plr_odometry_verdict;

/* The sum forgets; what is usual is kept. */
void plr_odometry_forget(plr_supervisor *s);

/* True if the odometry has agreed with the pictures on this drive: an event needs a before. */
bool plr_odometry_has_before(const plr_supervisor *s);

/* Adds a frame's motion. `held`: its last reading is too old to say where the body would be by odometry.
 * `tells`: the frame shows what is usual; one of few points, or after a time in the dark, does not. */
plr_odometry_verdict plr_odometry_add(plr_supervisor *s, const plr_motion_evidence *m, bool held,
                                      bool tells);

/* The weight of the odometry in the next frame, once the doubt about it is known; `excess` as above. */
void plr_odometry_weigh(plr_supervisor *s, plr_real excess);

/* Adds to the difference between the pose by odometry and the present one: n, m and rad in the body, nu of
 * it in sigmas, and the expected square of nu by chance. */
void plr_odometry_differs(plr_supervisor *s, const plr_real n[PLR_POSE_DIM],
                          const plr_real nu[PLR_POSE_DIM], plr_real noise);

/* C = s (d d^T + a share of |d|^2 in all directions, because d is not known better than that) for the
 * difference d; s is the share of it that the odometry's noise does not explain: the rest is in P already. */
void plr_odometry_cover(const plr_supervisor *s, const plr_real d[PLR_POSE_DIM],
                        plr_real C[PLR_POSE_SQUARE]);

/* The difference has been covered for good. */
void plr_odometry_settle(plr_supervisor *s);

#endif
