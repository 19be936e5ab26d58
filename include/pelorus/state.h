// SPDX-License-Identifier: MIT
/*
 * What a filter is made of. It stands here so that the caller can reserve it statically; nothing of
 * it is for direct use, and its layout may change with any version.
 */
#ifndef PELORUS_STATE_H
#define PELORUS_STATE_H

#include <stddef.h>

#include "pelorus/camera.h"
#include "pelorus/config.h"
#include "pelorus/settings.h"
#include "pelorus/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Where landmarks go to and come from. Both functions may be NULL. They must not call the
 * filter. */
typedef struct plr_map {
    void *context;
    /* Takes an evicted landmark. 0 = taken; anything else: the filter keeps the landmark. */
    int (*sink)(void *context, const plr_landmark *landmark);
    /* Looks up an id: fills position, covariance and id, and returns true; false if unknown. */
    bool (*source)(void *context, uint32_t id, plr_landmark *landmark);
} plr_map;

/* Counts since init or reset. */
typedef struct plr_totals {
    uint32_t twists;        /* accepted */
    uint32_t frames;        /* accepted */
    uint32_t late;          /* frames refused with PLR_E_LATE */
    uint32_t refused;       /* other calls refused for their data */
    uint32_t resets;        /* poses set from outside */
    uint32_t locks;         /* times the gate was locked */
    uint32_t range_limited; /* landmark corrections stopped: see PLR_REASON_RANGE_LIMITED */
    uint32_t blocks_failed;
    uint32_t widened;        /* times the covariance was widened: the pose may have jumped */
    uint32_t recoveries;     /* landmarks dropped to go on after a divergence */
    uint32_t contradictions; /* times vision's word was taken against the twists */
    uint32_t twists_refused, frames_refused; /* for any reason */
    uint32_t damaged;                        /* frames refused with PLR_E_DAMAGED */
    uint64_t observations, matched, used, gated, created, evicted;
    plr_time_ns diverged_ns; /* when a variance ceased to be positive; 0: never */
} plr_totals;

/* One landmark slot. */
typedef struct plr_slot {
    plr_real x[PLR_LANDMARK_DIM]; /* body: q in the current left camera; world: m; metres */
    plr_real
        beyond; /* body: the inverse range is 1 / |x| + beyond, 1/m; negative for a point that the
                        pixels' noise has put beyond infinity */
    uint32_t id;
    uint32_t times_seen;
    uint32_t times_gated;
    uint32_t last_frame; /* number of the frame that saw it last */
    uint32_t print;      /* of the pixels that it was seen at last */
    plr_time_ns last_seen_ns;
    plr_real lean[3],
        lean_variance; /* fading sum of its whitened innovations; and what its variance
                                        would be if they were white */
    uint8_t known;
    uint8_t strays;    /* 1: they were not; the point moves */
    uint8_t chances;   /* times it began anew */
    uint16_t accepted; /* frames that used it since it was born, or began anew */
    uint16_t rejected; /* successive frames that matched it in vain */
} plr_slot;

/* Motion since the covariance was last brought up to date: xi+ = Ad(D^-1) xi + B db + N(0, Q). */
typedef struct plr_motion {
    plr_real E[9], p[3]; /* D = (I + E, p) */
    plr_real Q[36];      /* 6x6 */
    plr_real B[36];      /* 6x6 */
    plr_real seconds;    /* for the bias walk */
    uint8_t pending;     /* 1 if any motion is accumulated */
    uint8_t noisy;       /* 0 if it is exact (mapping): Q and B are zero */
} plr_motion;

/* Sums over frames that fade: of nu, how the motion differed from the twists in their sigmas, and
 * of the covariance that it should have had. */
typedef struct plr_consistency_window {
    plr_real sum[6];
    plr_real variance[21]; /* 6x6, packed upper triangle */
} plr_consistency_window;

enum { PLR_CONSISTENCY_WINDOWS = 3 };

/* Whether twists and pictures tell the same story; see src/filter/consistency.h. */
typedef struct plr_consistency {
    plr_consistency_window windows[PLR_CONSISTENCY_WINDOWS];
    plr_real apart[6];          /* between the two stories, as a twist of the body: m, rad */
    plr_real apart_sigmas[6];   /* the same in the twists' sigmas */
    plr_real apart_noise;       /* what its square would be by their noise */
    plr_real still_way[6];      /* what the twists moved while the picture stayed the same */
    plr_real still_variance[6]; /* and its variance */
    plr_real matched, gated, nis, nis_dof; /* counts of the frames, fading */
    uint16_t agreeing;                     /* frames in agreement, one after the other */
    plr_real excess;                       /* |L^-1 n|^2 of a frame that contradicted the twists
                                              outright, fading */
    uint16_t insisting;                    /* frames that contradict the twists by much */
    uint16_t slight;                       /* frames in which they differ by little */
    uint8_t contradicted;                  /* 1: the twists are not believed */
    uint8_t drifting;                      /* 1: over many frames they differ by more than noise */
    uint8_t frozen;                        /* 1: this frame's picture was sent before */
    uint8_t doubtful;                      /* 1: the pose may be wrong */
} plr_consistency;

/* The settings and the camera as the filter computes with them: in its own precision, squared. */
typedef struct plr_parameters {
    plr_camera camera;
    plr_real Ad_CB[36]; /* Ad(T_CB): body twists to the camera */
    plr_real pixel_variance;
    plr_real velocity_variance[3], gyro_variance[3]; /* of the body's axes */
    plr_real bias_velocity_walk, bias_gyro_walk;
    plr_real gate_d2, gate_residual2;
    plr_real min_disparity, max_depth, max_row_gap, min_depth;
    plr_real landmark_variance;
    plr_real min_inverse_range;
    plr_time_ns max_gap_ns;
} plr_parameters;

/* The noise of a frame's motion, kept out of P until the frame's observations are in: the state is
 * x + W nu with nu ~ N(0, I) a priori, and what the observations tell of nu gathers as information.
 * docs/MATH.md 10. */
typedef struct plr_noise {
    plr_real Wt[PLR_POSE_DIM * PLR_MAX_LD + PLR_KERNEL_MARGIN]; /* W^T, 6 x dim */
    plr_real Lambda[21 + PLR_KERNEL_MARGIN];                    /* 6x6, packed upper triangle */
    plr_real eta[PLR_POSE_DIM];
    plr_real z[PLR_POSE_DIM]; /* nu is counted from here */
    plr_real
        closer[PLR_MAX_LANDMARKS]; /* by which a slot's inverse range is about to change, 1/m */
    uint8_t open;                  /* 1: W is part of the covariance and not yet in P */
} plr_noise;

/* Workspace of one call; nothing in it lives longer. */
typedef struct plr_workspace {
    /* Rows of V^T in an update, of [Y G]^T in a predict; a 3x3 matrix a landmark in a transport.
     * The kernels read a little further than they use, hence the margins. */
    plr_real Vt[PLR_WORK_ROWS * PLR_MAX_LD + PLR_KERNEL_MARGIN];
    plr_real S[PLR_BLOCK_ROWS * (PLR_BLOCK_ROWS + 1) / 2 +
               PLR_KERNEL_MARGIN]; /* packed upper triangle */
    plr_real y[PLR_BLOCK_ROWS];
    plr_real dx[PLR_MAX_LD];
    plr_real diagonal[PLR_MAX_LD];          /* of P, as a block would leave it */
    plr_noise noise;                        /* of the motion that this frame applies */
    plr_real gain[PLR_MAX_OBSERVATIONS];    /* how much order[k] would tell; see gate.h */
    uint16_t order[PLR_MAX_OBSERVATIONS];   /* good observations of the frame, by id */
    uint16_t slot_of[PLR_MAX_OBSERVATIONS]; /* the slot of order[k], or PLR_NO_SLOT */
    uint16_t used[PLR_MAX_OBSERVATIONS];    /* positions k in order that go into the update */
} plr_workspace;

/* Sums of the filter's memory, by which a call sees that nobody else wrote to it. */
typedef struct plr_guard {
    uint64_t constant, small, large;
} plr_guard;

/* The order of the members counts: config to model never change, and work is of one call. */
typedef struct plr_filter {
    uint32_t magic; /* set by a successful init */
    plr_config config;
    plr_map map;
    plr_parameters par;
    uint8_t model; /* plr_model_kind: of the table of models */

    plr_time_ns t_ns;       /* of the estimate */
    plr_time_ns reading_ns; /* of the last twist */
    plr_real interval_s;    /* between the last two twists */
    uint8_t clock_started, reading_valid;
    uint8_t diverged;

    plr_real R_WB[9];
    double p_WB[3]; /* double in both builds: a float32 would round small steps away */
    plr_real bias[PLR_BIAS_DIM];
    plr_real bias_prior[PLR_BIAS_DIM], bias_prior_sigma[PLR_BIAS_DIM];
    plr_real recovery_P[21]; /* the pose's covariance, last in order, carried along; packed lower */
    plr_real reading[6];     /* last twist */
    plr_motion motion;

    unsigned count; /* active slots, dense from 0 */
    plr_slot slots[PLR_MAX_LANDMARKS];
    plr_real P[PLR_PACKED_SIZE + PLR_KERNEL_MARGIN]; /* packed lower triangle: pose, bias,
                                                        landmarks */
    plr_workspace work;

    plr_consistency consistency;
    uint32_t frame_number; /* from here on it is guarded with the small state */
    uint8_t health;        /* plr_health of the last frame, and why */
    uint32_t reasons;
    plr_time_ns last_frame_ns, last_use_ns; /* 0: none yet */
    uint32_t refused_before;                /* twists refused until the last frame */
    uint16_t frames_without_use, frames_mostly_gated;
    uint32_t matches_since_gated;
    plr_totals totals;
    plr_guard guard; /* last: what stands before it is guarded */
} plr_filter;

#ifdef __cplusplus
}
#endif

#endif
