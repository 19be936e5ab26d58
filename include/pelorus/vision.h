// SPDX-License-Identifier: MIT
/*
 * Eyes: from the two pictures of a stereo camera to the observations that the filter takes. A part of the
 * library that knows public headers and no filter: it follows corners and says how well; what to believe
 * is decided by the filter. docs/EYES.md shows what it does, how large it is, and what it cannot see.
 *
 * One struct of the caller's holds everything; there is no heap, and a pair takes a bounded time. Pixels
 * are integers, the rest is PLR_FMA and square roots: the same pictures give the same bits everywhere.
 *
 * Pictures need not be rectified. Observations are those of a virtual rectified camera C, whose x axis is
 * the baseline: plr_vision_calibration tells it, for plr_filter_init.
 *
 *     plr_vision_init(&eyes, &rig);
 *     plr_vision_calibration(&eyes, &T_LB, &calibration);
 *     ...
 *     plr_vision_track(&eyes, &pair, &expected, &frame);
 *     plr_filter_update(&filter, &frame, &report);
 */
#ifndef PELORUS_VISION_H
#define PELORUS_VISION_H

#include "pelorus/config.h"
#include "pelorus/rig.h"
#include "pelorus/types.h"

#ifdef __cplusplus
extern "C" {
#endif

/* --- what goes in --- */

/* An 8-bit grey picture. It is read where it lies until plr_vision_track returns, and not copied. */
typedef struct plr_picture {
    const uint8_t *pixels;
    uint32_t stride; /* bytes from one row to the next */
    uint16_t width_px, height_px;
    plr_time_ns t_ns; /* of its first row */
} plr_picture;

typedef struct plr_picture_pair {
    plr_picture left, right;
} plr_picture_pair;

/* How far away a point is, for tracks of which the caller knows it better than the last disparity. */
typedef struct plr_depth {
    uint32_t id;
    float z_m; /* in the virtual camera, at the last pair */
} plr_depth;

/* How the camera is expected to have moved since the last pair: the point that was at x is now at
 * R x + p, in the axes of the virtual camera C. A gyro alone knows R: with p = 0 each track is expected to go
 * on drifting beside R as it last did. */
typedef struct plr_expected {
    plr_pose motion;
    const plr_depth *depths; /* or NULL */
    uint16_t depth_count;
    /* How C moves at the time of this pair, in its own axes: what is not taken at the frame's time, rows of a
     * rolling shutter and a half that is late, is moved by it. Else the mean since the last pair must do, which is
     * older by half the time between them. */
    bool velocity_known;
    double v_C_mps[3], w_C_radps[3];
} plr_expected;

/* --- what comes out --- */

/* Why a track ended. */
typedef enum plr_track_end {
    PLR_TRACK_LEFT_VIEW = 1, /* it left the left picture, or is expected outside it */
    PLR_TRACK_UNLIKE = 2,    /* what is there now does not look like the patch of its birth */
    PLR_TRACK_MOVED = 3,     /* the fit led farther away than it can be trusted */
    PLR_TRACK_NO_RIGHT =
        4, /* not found in the right picture, PLR_VISION_MISSES times in succession */
    PLR_TRACK_CROWDED = 5, /* an older track follows the same point */
    PLR_TRACK_UNSEEN = 6,  /* the pictures could not be used for PLR_VISION_MISSES pairs */
    PLR_TRACK_ENDS = 7
} plr_track_end;

enum { PLR_VISION_MISSES = 5 };

/* Of each observation that is handed out, in the same order. */
typedef struct plr_sight {
    uint32_t id;
    uint16_t age; /* pairs since its birth, 0 in the first */
    float
        sigma_px; /* of its pixels in the virtual camera: root of the mean variance of uL, vL and uR, from
                       the fits themselves: contrast, residuals, and what a patch cut anew has cost */
    float likeness; /* normalised correlation with the patch of its birth, at most 1 */
} plr_sight;

typedef struct plr_ended_track {
    uint32_t id;
    uint16_t age;
    uint8_t why; /* plr_track_end */
} plr_ended_track;

/* What is wrong with a picture: bits. */
typedef enum plr_picture_fault {
    PLR_PICTURE_DARK = 1 << 0,   /* nearly black: a lens cap, no light, an exposure far too short */
    PLR_PICTURE_BRIGHT = 1 << 1, /* nearly white: overexposed */
    PLR_PICTURE_FLAT =
        1 << 2, /* no contrast anywhere: fog, a covered lens, a wall without texture */
    PLR_PICTURE_REPEATED =
        1 << 3, /* the last one again. If both halves repeat, so do the observations, and
                                      the filter judges; if one does, the pair is none and shows nothing */
    PLR_PICTURE_UNUSABLE = PLR_PICTURE_DARK | PLR_PICTURE_BRIGHT | PLR_PICTURE_FLAT
} plr_picture_fault;

/* What happened to one pair. */
typedef struct plr_vision_report {
    plr_time_ns t_ns;    /* of the frame: the middle row of the left picture */
    uint8_t left, right; /* bits of plr_picture_fault */
    bool
        swapped; /* points are found where the other side should be: left and right are exchanged */
    uint16_t followed; /* tracks that were found again in the left picture */
    uint16_t
        observed; /* and in the right one, where rows agree: these and the born are handed out */
    uint16_t born;
    uint16_t corners;  /* tried as births */
    uint16_t cut_anew; /* patches that had become too different from those of their births */
    uint16_t ended;    /* tracks, of plr_vision.ended */
    uint16_t steps;    /* of fits, a measure of the work */
    float
        halves_apart_s; /* by how much later than its time the right picture seems to have been taken, from
                             rows that differ as the camera pitches and rolls, */
    float halves_sigma_s; /* and the standard deviation of that; 0: nothing is known yet */
} plr_vision_report;

/* --- the caller's memory --- */

/* A pinhole and its lens in the library's precision. */
typedef struct plr_optics {
    plr_real fx, fy, cx, cy, k[8];
    uint8_t model;
} plr_optics;

enum {
    PLR_PATCH_SIDE = 9,                  /* of what is compared, px */
    PLR_PATCH_KEPT = PLR_PATCH_SIDE + 2, /* with a margin for its gradients */
    PLR_PATCH_BYTES = PLR_PATCH_KEPT * PLR_PATCH_KEPT
};

/* A small piece of a surface, seen in the left picture. */
typedef struct plr_surface {
    plr_real disparity; /* in the virtual camera, px */
    plr_real
        slope[2]; /* and how that changes from px to px of the left picture: how the surface lies */
} plr_surface;

/* A point that is followed. */
typedef struct plr_track {
    uint32_t id;
    uint16_t age;
    uint8_t misses;         /* pairs in succession without an observation */
    uint8_t why;            /* plr_track_end, once it has ended */
    uint8_t levels;         /* of its patch: near the edge a coarse one does not fit */
    bool seen;              /* in both pictures of the last pair */
    plr_real at[2];         /* in the left picture, raw px */
    plr_real right[2];      /* in the right one, when it was last found there */
    plr_real drift[2];      /* from where it was expected to where it was found, px */
    plr_surface surface;    /* when it was last measured */
    plr_real slope_info[3]; /* of its slope, from fits: inverse of a covariance, xx xy yy */
    plr_real A[4];          /* from the patch to the left picture as it is now */
    plr_real cov[3];        /* of `at`, xx xy yy, from the last fit */
    plr_real var_right;     /* of uR beside uL */
    plr_real row_gap;       /* by how much its right row is lower, px of the virtual camera */
    plr_real var_cut;       /* what cutting anew has cost, px^2 */
    plr_real likeness;
    uint8_t patch[PLR_VISION_LEVELS][PLR_PATCH_BYTES];
} plr_track;

/* Rows that differ, beside those that the expected turn would make differ in a second: sums. */
typedef struct plr_row_gaps {
    plr_real count, rate, gap, rate2, gap_rate, gap2;
} plr_row_gaps;

/* Everything. Members are the library's own, except those that are said to be read. */
typedef struct plr_vision {
    uint32_t ready;
    plr_optics optics[2];
    uint16_t width, height, wanted, disparity_max;
    uint8_t levels;
    plr_real row_time;
    plr_real fx, fy, cx, cy, baseline; /* of the virtual camera */
    plr_real R_CS[2][9];               /* left and right camera to virtual camera */
    plr_time_ns t_ns;
    bool has_pair;
    uint32_t next_id, hash[2], proper, mirrored;
    plr_row_gaps gaps;
    plr_track tracks[PLR_VISION_TRACKS];
    uint16_t track_count, shown;
    uint8_t pyramid[2][PLR_VISION_PIXELS / 3 + 1]; /* all levels but the pictures themselves */
    /* To be read, until the next call: */
    plr_vision_report report;
    plr_observation observations[PLR_VISION_TRACKS]; /* of the frame, by ascending id */
    plr_sight sights[PLR_VISION_TRACKS];             /* beside them */
    plr_ended_track ended[PLR_VISION_TRACKS];        /* report.ended of them */
} plr_vision;

/* --- calls --- */

/* The sizes that a plr_vision depends on, as one compiler run has them. */
typedef struct plr_vision_sizes {
    uint32_t bytes, real, pixels, tracks, levels;
} plr_vision_sizes;

/* Returns those of this compiler run, for a struct of so many bytes. */
static inline plr_vision_sizes plr_vision_sizes_here(uint32_t bytes) {
    plr_vision_sizes here;
    here.bytes = bytes;
    here.real = PLR_REAL;
    here.pixels = PLR_VISION_PIXELS;
    here.tracks = PLR_VISION_TRACKS;
    here.levels = PLR_VISION_LEVELS;
    return here;
}

/* plr_vision_init for a caller whose compiled-in sizes are given; use plr_vision_init. */
plr_status plr_vision_init_sized(plr_vision *v, const plr_rig *rig, const plr_vision_sizes *caller);

/* Prepares eyes for this rig, which need not outlive the call.
 * PLR_E_ARGUMENT null pointer, or an impossible size, lens model, row time or count; PLR_E_RANGE pictures of
 * more than PLR_VISION_PIXELS; PLR_E_NOT_FINITE; PLR_E_CALIBRATION a focal length that is not positive,
 * cameras that do not stand side by side with the second on the right, or a rotation that is none;
 * PLR_E_SIZE the caller was compiled with other sizes. */
static inline plr_status plr_vision_init(plr_vision *v, const plr_rig *rig) {
    const plr_vision_sizes here = plr_vision_sizes_here((uint32_t)sizeof(plr_vision));
    return plr_vision_init_sized(v, rig, &here);
}

/* The virtual camera, on a body of which T_LB says where the left camera is: x_L = R x_B + p. */
plr_status plr_vision_calibration(const plr_vision *v, const plr_pose *T_LB,
                                  plr_calibration *calibration);

/* Forgets all tracks, as after a cut in the recording. Ids go on. */
plr_status plr_vision_forget(plr_vision *v);

/* Follows all tracks into this pair, finds new ones, and hands out a frame: its observations lie in `v` until
 * the next call. `expected` may be NULL: nothing is known of the motion.
 * PLR_E_NOT_READY no init; PLR_E_ARGUMENT a null pointer, a stride below the width, or pictures of another
 * size than the rig's: they are not those of its calibration; PLR_E_TIME not later than the last pair, or
 * halves more than a quarter second apart; PLR_E_NOT_FINITE, PLR_E_RANGE the expected motion is not finite,
 * no rotation, or more than 100 m, 1,000 m/s or 100 rad/s. After an error nothing has changed. */
plr_status plr_vision_track(plr_vision *v, const plr_picture_pair *pair,
                            const plr_expected *expected, plr_frame *frame);

#ifdef __cplusplus
}
#endif

#endif
