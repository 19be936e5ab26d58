// SPDX-License-Identifier: MIT
/* A part of the filter's memory (state.h): what a call works with, and no later call uses. For the library
 * alone. */
#ifndef PELORUS_WORKSPACE_H
#define PELORUS_WORKSPACE_H

#include "pelorus/config.h"
#include "pelorus/types.h"

/* The noise of a frame's motion. It is kept apart from P until the frame's observations have been
 * applied: the state's error is x + W nu with nu ~ N(0, I) beforehand, and the observations add
 * information (Lambda, eta) about nu. docs/MATH.md 10. */
typedef struct plr_noise {
    plr_real Wt[PLR_POSE_DIM * PLR_MAX_LD + PLR_KERNEL_MARGIN]; /* W^T, 6 x dim */
    plr_real Lambda[PLR_POSE_TRIANGLE + PLR_KERNEL_MARGIN];     /* 6x6, packed upper triangle */
    plr_real eta[PLR_POSE_DIM];
    plr_real eta_of_S[PLR_CALIBRATIONS][PLR_POSE_DIM]; /* the same of the columns of S */
    plr_real z[PLR_POSE_DIM];               /* the value of nu at which the motion was linearised */
    plr_real motion_variance[PLR_POSE_DIM]; /* of the six numbers of the motion; 0: exact */
    plr_real
        range_shift[PLR_MAX_LANDMARKS]; /* linearisation point minus estimate, inverse range, 1/m */
    uint8_t open;                       /* 1: W belongs to the covariance and is not in P yet */
} plr_noise;

/* What a correction says of the calibration's errors s: J s = eta, J of the estimated by all. */
typedef struct plr_learnt {
    plr_real J[PLR_CALIBRATIONS * PLR_CALIBRATIONS], eta[PLR_CALIBRATIONS];
} plr_learnt;

/* An observation of the frame at hand, and what becomes of it: a row of the frame. */
typedef struct plr_sighting {
    const plr_observation *seen; /* the caller's, while the call lasts */
    uint16_t slot;               /* of its landmark, or PLR_NO_SLOT */
    uint8_t verdict;             /* plr_gate_result in gate.h */
    uint8_t used;                /* 1: the correction is to use it */
} plr_sighting;

/* What a frame shows of a landmark, linearised once and kept until the correction: three rows r = H x +
 * noise (src/sensor/measurement.h). */
typedef struct plr_linearised {
    plr_real H[PLR_ROWS * PLR_LANDMARK_DIM]; /* derivative by the landmark */
    plr_real r[PLR_ROWS], R[PLR_ROWS];       /* R: variances of the noise */
    plr_real d2; /* the squared distance from its prediction that the gate has judged, in sigmas */
    plr_real det_S; /* of the prediction's covariance: the larger, the more the observation tells */
} plr_linearised;

/* A frame: its valid observations, ascending by id, no id twice, and no two of one slot. */
typedef struct plr_sightings {
    plr_sighting at[PLR_MAX_OBSERVATIONS];
    /* Of those with a landmark, by its slot. Where the rows depend on the pose too, in `world`, that
     * derivative stands in plr_noise.Wt: such a model leaves it unused. */
    plr_linearised of_slot[PLR_MAX_LANDMARKS];
    uint16_t count;
    uint8_t terms; /* 2: the rows depend on the pose too */
} plr_sightings;

/* Workspace of one call. Later calls read two things of it: the rows of the last frame, for
 * plr_filter_supervision, and noise.open, which is 0 between frames. */
typedef struct plr_workspace {
    /* Rows of V^T in an update, of [Y G]^T in a predict; a 3x3 matrix a landmark in a transport.
     * The kernels read a little further than they use, hence the margins. */
    plr_real Vt[PLR_WORK_ROWS * PLR_MAX_LD + PLR_KERNEL_MARGIN];
    plr_real dx[PLR_MAX_LD];
    plr_noise noise;         /* of the motion that this frame applies */
    plr_learnt learnt;       /* what this correction says of the calibration */
    plr_sightings sightings; /* the frame */
} plr_workspace;

#endif
