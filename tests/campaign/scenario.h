// SPDX-License-Identifier: MIT
/* What is simulated, and what it must come to: a row of the campaign's table. */
#ifndef CAMPAIGN_SCENARIO_H
#define CAMPAIGN_SCENARIO_H

#include <stdbool.h>
#include <stdint.h>

#include "pelorus/settings.h"

/* What goes wrong between `before` and `before + during` frames. */
typedef enum mishap {
    NOTHING = 0,
    SLIP,        /* all six numbers of a reading are multiplied by the strength */
    DEAD_WHEELS, /* the velocity reads zero, exactly */
    DEAD_TWISTS, /* velocity and rate read zero, exactly */
    DEAD_GYRO,   /* the rate does */
    GYRO_SCALE,  /* the rate is multiplied by the strength */
    FROZEN,      /* the camera repeats its last frame under new times */
    JUMP_BODY,   /* the body is set aside by the strength, m, at the first frame */
    JUMP_CAMERA, /* the camera is, and stays there */
    CAMERA_BACK, /* the camera is, and is put back at the end of the event */
    TURN_CAMERA, /* the camera is turned about its vertical axis by the strength, rad, and likewise */
    SCENE_MOVES, /* every point moves sideways at the strength, m/s */
    CONVOY,      /* points move with the body at 0.8 of its speed; the strength: share of them */
    LATE_TWISTS, /* readings come after the frame and are stamped so many seconds back */
    BASELINE,    /* the true baseline is so much larger than the filter's, as a share; all along */
    FOCAL,       /* the true focal length; all along */
    ASKEW,   /* the camera is turned by so many degrees beside T_CB, about any axis; all along */
    THROWN,  /* the body is thrown by 5 m and 1 rad times the strength at the first frame */
    SWAPPED, /* from the first frame on every id stands for another point */
    BLIND    /* no point is seen, and the readings are garbage */
} mishap;

/* The limits; 0: none. */
typedef struct bars {
    double nees;         /* mean of NEES/6 over seeds, less two standard errors */
    double event_nees;   /* the same during an event, and after it */
    double sigmas;       /* no component of an error is ever beyond so many of its sigmas */
    double forward_bias; /* mean of its error in sigmas over seeds, less two standard errors */
    double good;         /* least share of frames GOOD where nothing is wrong */
    double silent;       /* share of frames GOOD and beyond 5 sigma, during and after an event */
    double told_frames;  /* until an event is told, in 95 % of the seeds */
    double error_m;      /* mean position error at the end of an event */
    double again_s;      /* from true again to GOOD again, in 95 % of the seeds */
    double later_sigmas; /* largest component of the error one second after the event */
    double later_width;  /* own sigma then, beside the error then and a fresh start's sigma */
    bool no_divergence;
} bars;

typedef struct scenario {
    const char *name, *about;
    bool room; /* all points stand around the start for good, and the body goes in a circle */
    double speed_mps, turn; /* turn 1: the usual bends, or a circle in 20 s; 0: none */
    double near_m, far_m;   /* depths at which points appear */
    double baseline_m;
    unsigned landmarks; /* offered in a frame */
    unsigned slots;     /* 0: the filter's default */
    unsigned twists_per_frame;
    double pixel_px, velocity_mps, gyro_radps; /* true, and told to the filter */
    bool bias;            /* biases drawn from the prior and estimated; else none, and off */
    bool few;             /* 0, 1, 2 matches in turn after the first second */
    double wrong_matches; /* share of observations that show another point, each for one frame */
    double track_drift;   /* by which tracks wander off their point in a second, px */
    double told_drift;    /* what the filter is told of it */
    double lost_tracks;   /* share of tracks that show another point from a frame on */
    unsigned before, during, after; /* frames */
    mishap mishap;
    double strength;
    bool is_long; /* frames and seeds depend on --short and --long: parked */
    bars bars;
} scenario;

enum { FRAME_HZ = 10 };

/* The policy that a scenario is judged by, a plr_scene_policy: where most of what is seen moves, it says so. */
static inline uint8_t scenario_scene(const scenario *s) {
    const bool moves = s->mishap == SCENE_MOVES || s->mishap == CONVOY ||
                       s->mishap == JUMP_CAMERA || s->mishap == CAMERA_BACK ||
                       s->mishap == TURN_CAMERA;
    return moves ? PLR_SCENE_MAY_MOVE : PLR_SCENE_STANDS;
}

extern const scenario scenarios[];
extern const unsigned scenario_count;

/* Changes fields: "speed=2,bias=1". Returns NULL, or the first part that makes no sense. */
const char *scenario_change(scenario *s, const char *changes);

/* The names of what can be changed, with commas. */
void scenario_fields(char *text, unsigned size);

#endif
