// SPDX-License-Identifier: MIT
/*
 * The vocabulary that filter, wire and session share: status, pose, twist, observation, landmark,
 * report. Numbers cross the interface as double: exact for a float32 filter too.
 *
 * Frames: W world, B body, C left camera (x right, y down, z forward). T_WB = (R_WB, p_WB) brings
 * body coordinates to the world: x_W = R_WB x_B + p_WB. Matrices are row by row.
 */
#ifndef PELORUS_TYPES_H
#define PELORUS_TYPES_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Time in nanoseconds; the zero is the recorder's choice. */
typedef uint64_t plr_time_ns;

/* What a call came to. Errors are negative; after an error the filter is as it was before. */
typedef enum plr_status {
    PLR_OK = 0,
    PLR_E_ARGUMENT = -1,    /* a null pointer, a count beyond the capacity, an impossible value */
    PLR_E_CONFIG = -2,      /* a setting makes no sense; plr_config_check tells which */
    PLR_E_CALIBRATION = -3, /* focal length, baseline or extrinsic make no sense */
    PLR_E_NOT_FINITE = -4,  /* an input holds NaN or infinity */
    PLR_E_RANGE = -5,       /* an input is beyond what a step can hold, for example pi rad a step */
    PLR_E_TIME = -6,        /* time repeats or goes back */
    PLR_E_LATE = -7,        /* a frame is older than the last predict */
    PLR_E_GAP = -8,         /* time jumps forward by more than the setting max-gap */
    PLR_E_MODE = -9,        /* the call does not belong to the mode in force */
    PLR_E_FULL = -10,       /* no slot is free, or a device is too small for the state */
    PLR_E_EXISTS = -11,     /* a landmark of this id is in the state already */
    PLR_E_DIVERGED = -12,   /* a variance is not positive: there is nothing to tell or to save */
    PLR_E_NOT_READY = -13,  /* the filter was never initialised, or the session saw no HEADER yet */
    PLR_E_CPU = -14,        /* the processor flushes subnormals to zero */
    PLR_E_CORRUPT = -15,    /* stored bytes fail their check */
    PLR_E_FOREIGN = -16, /* of another version or build; a saved state: or calibration, setting */
    PLR_E_IO = -17,      /* the port reports a failure */
    PLR_E_DAMAGED = -18, /* the filter's memory does not hold what it should: init again */
    PLR_E_SIZE = -19 /* caller and library were compiled with other sizes or another precision */
} plr_status;

/* How far the estimate may be trusted. */
typedef enum plr_health {
    PLR_HEALTH_GOOD = 0,     /* nothing to report */
    PLR_HEALTH_DEGRADED = 1, /* works, with less than it should have: see the reasons */
    PLR_HEALTH_LOST = 2,     /* the pose goes on by prediction alone, or vision contradicts it */
    PLR_HEALTH_DIVERGED = 3  /* the filter's memory was changed by something else: init again */
} plr_health;

/* Why health is not good: bits of plr_report.reasons and plr_health_state.reasons. Beside each: what
 * it means, what causes it; what to do. */
typedef enum plr_reason {
    /* Fewer than 3 observations used in this frame: a bare wall, darkness, a covered camera, or the
     * gate rejects what is seen. Passes by itself; if it stays, look at the tracker. */
    PLR_REASON_FEW_OBSERVATIONS = 1 << 0,
    /* None used in the last 10 frames, or for a second: the pose goes on by twists alone and drifts.
     * As above. */
    PLR_REASON_NO_OBSERVATIONS = 1 << 1,
    /* Most matches rejected in 10 successive frames; the landmarks were dropped. The camera was moved,
     * ids changed their meaning, or a sigma is far too small. */
    PLR_REASON_GATE_LOCKED = 1 << 2,
    /* 0 of the last 1000 matches rejected. The gate, or pixel-sigma, is too wide to guard. */
    PLR_REASON_GATE_INERT = 1 << 3,
    /* An innovation covariance could not be factorised; its observations were left out. Numbers of
     * very different size: check pixel-sigma, start-sigma and the covariances that were given. */
    PLR_REASON_BLOCK_FAILED = 1 << 4,
    /* The map sink refused a landmark, which stays and holds its slot. Make room in the sink. */
    PLR_REASON_SINK_FAILED = 1 << 5,
    /* New landmarks found no slot. More slots, or fewer features from the tracker. */
    PLR_REASON_NO_ROOM = 1 << 6,
    /* Observations were malformed or ids were doubled: a fault of the tracker or of the link. */
    PLR_REASON_REFUSED_INPUT = 1 << 7,
    /* Innovations are larger than the noise explains: pixel-sigma, or a twist's sigma, is too small,
     * or the calibration is off. */
    PLR_REASON_NIS_HIGH = 1 << 8,
    /* An update would have turned a landmark's bearing by more than 1 rad, or put it nearer than 1 cm,
     * and was stopped there: a point beside the camera, or a wrong match that the gate let through. */
    PLR_REASON_RANGE_LIMITED = 1 << 9,
    /* A variance ceased to be positive, and the filter recovered in the same frame: see RECOVERED.
     * Numbers of very different size: check the sigmas and the covariances that were given. */
    PLR_REASON_NOT_POSITIVE = 1 << 10,
    /* Observations were left out for want of time. A longer deadline, or fewer features. */
    PLR_REASON_BUDGET = 1 << 11,
    /* Vision contradicts the twists, and vision's word was taken: slipping wheels, a dead encoder, a
     * push. Check the wheels if it comes again; if always, the scale of the odometry. */
    PLR_REASON_TWIST_CONTRADICTED = 1 << 12,
    /* After a lost lock or a contradiction: the pose may be wrong by more than its covariance says,
     * until what was contradicted agrees again. Drive with care, or set the pose to end it. */
    PLR_REASON_POSE_MAY_BE_WRONG = 1 << 13,
    /* A bias estimate is beyond 3 sigma of its prior. Stereo and odometry disagree in scale (baseline,
     * focal length, wheel radius; which of them cannot be known), or bias-*-sigma is too small. */
    PLR_REASON_BIAS_OFF_PRIOR = 1 << 14,
    /* Innovations are far smaller than the noise says, over many frames: pixel-sigma is too large, or
     * the tracker smooths what it sees. The pose is better than its covariance says. */
    PLR_REASON_NIS_LOW = 1 << 15,
    /* The same pixels in successive frames while the twists go on: a camera or a tracker that sends
     * the same image again. Restart it. */
    PLR_REASON_FROZEN_IMAGE = 1 << 16,
    /* The matched points do not agree on one motion: more than 30 % are rejected. Much of the scene
     * moves, or tracks are stale. The pose leans on the twists until they agree. */
    PLR_REASON_SCENE_DISAGREES = 1 << 17,
    /* To go on after a divergence, the landmarks were dropped and the pose's covariance was widened.
     * Told once; the reset counter of POSE and ODOMETRY counts it. */
    PLR_REASON_RECOVERED = 1 << 18,
    /* No frame came for more than a second. Camera, tracker or link are silent; plr_filter_health
     * alone tells it, as a report needs a frame. */
    PLR_REASON_NO_FRAMES = 1 << 19,
    /* A guard found the filter's memory changed: a stray write, a flipped bit, a stack that grew into
     * it. plr_filter_init anew; if it comes again, look for the writer. */
    PLR_REASON_STATE_DAMAGED = 1 << 20,
    /* Twists are missing, refused, or one was held for too long. Check the odometry and its link. */
    PLR_REASON_NO_TWISTS = 1 << 21
} plr_reason;

/* A rigid motion. */
typedef struct plr_pose {
    double R[9]; /* rotation, row by row */
    double p[3]; /* m */
} plr_pose;

/* Velocity of the body in its own axes. */
typedef struct plr_twist {
    double v_B_mps[3];
    double w_B_radps[3];
} plr_twist;

/* One landmark in a rectified stereo pair. */
typedef struct plr_observation {
    uint32_t id; /* the same id means the same point, as long as the filter holds it */
    float uL_px, vL_px, uR_px, vR_px;
} plr_observation;

/* No limit on the observations of a frame. */
enum { PLR_NO_BUDGET = 65535 };

/* All observations of one stereo pair. */
typedef struct plr_frame {
    plr_time_ns t_ns;
    uint16_t budget; /* at most so many observations may be used; PLR_NO_BUDGET: all */
    uint16_t count;  /* observations, at most PLR_MAX_OBSERVATIONS */
    const plr_observation *observations;
} plr_frame;

/* A landmark in the world. */
typedef struct plr_landmark {
    uint32_t id;
    uint32_t times_seen;
    uint32_t times_gated;
    plr_time_ns last_seen_ns;
    bool known; /* it came from a map source or plr_filter_insert_known */
    double p_W_m[3];
    double P_W_m2[9]; /* covariance of the position, with the pose's uncertainty */
} plr_landmark;

/* The stereo camera and where it sits. */
typedef struct plr_calibration {
    double fx_px, fy_px, cx_px, cy_px;
    double baseline_m;
    plr_pose T_CB; /* body to left camera: q_C = R s_B + p */
} plr_calibration;

/* What happened to one stereo frame. */
typedef struct plr_report {
    plr_time_ns t_ns;
    plr_status status;
    plr_health health;
    uint32_t reasons;       /* bits of plr_reason */
    uint16_t budget;        /* as given */
    uint16_t observations;  /* in the frame */
    uint16_t matched;       /* of landmarks that the state holds */
    uint16_t used;          /* matched and through the gate, in a block that was applied */
    uint16_t gated;         /* matched and rejected */
    uint16_t created;       /* new landmarks */
    uint16_t evicted;       /* landmarks that left for the map sink */
    uint16_t refused;       /* not finite or beyond any image */
    uint16_t duplicates;    /* an id that stands twice in the frame: all of its copies refused */
    uint16_t no_room;       /* new ids without a free slot */
    uint16_t poor;          /* new ids refused by disparity, depth or row gap, or unknown in
                               localization */
    uint16_t left_out;      /* beyond the budget */
    uint16_t blocks_failed; /* blocks whose innovation covariance could not be factorised */
    uint16_t active;        /* landmarks in the state afterwards */
    uint16_t nis_dof;       /* 4 for each observation accepted: the mean that nis should have */
    float nis; /* sum of the gate distances d^2 of those accepted, left out or not; each
                               judged by what the others say of the motion (docs/MATH.md 8) */
} plr_report;

/* How it stands at some time, with or without a frame: plr_filter_health. Seconds are infinite
 * where there never was one; the reasons then say NO_FRAMES, NO_OBSERVATIONS or NO_TWISTS. */
typedef struct plr_health_state {
    plr_health health;
    uint32_t reasons;             /* bits of plr_reason */
    double seconds_without_frame; /* since the last frame that was taken */
    double seconds_without_use;   /* since the last observation that was used */
    double seconds_without_twist; /* since the last twist that was taken */
    uint32_t resets; /* what the reset counter of a POSE counts: poses set from outside, and times
                        the covariance was widened */
} plr_health_state;

#ifdef __cplusplus
}
#endif

#endif
