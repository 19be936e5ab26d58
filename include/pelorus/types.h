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
    PLR_E_DIVERGED = -12,   /* a variance is not positive: no update until a reset */
    PLR_E_NOT_READY = -13,  /* the filter was never initialised, or the session saw no HEADER yet */
    PLR_E_CPU = -14,        /* the processor flushes subnormals to zero */
    PLR_E_CORRUPT = -15,    /* stored bytes fail their check */
    PLR_E_FOREIGN = -16, /* of another version or build; a saved state: or calibration, setting */
    PLR_E_IO = -17       /* the port reports a failure */
} plr_status;

/* How far the estimate may be trusted. */
typedef enum plr_health {
    PLR_HEALTH_GOOD = 0,     /* nothing to report */
    PLR_HEALTH_DEGRADED = 1, /* works, with less than it should have: see the reasons */
    PLR_HEALTH_LOST = 2,     /* the pose goes on by prediction alone, or vision contradicts it */
    PLR_HEALTH_DIVERGED = 3  /* the covariance is broken: updates are refused until a reset */
} plr_health;

/* Why health is not good: bits of plr_report.reasons. */
typedef enum plr_reason {
    PLR_REASON_FEW_OBSERVATIONS = 1 << 0, /* fewer than 3 observations used in this frame */
    PLR_REASON_NO_OBSERVATIONS = 1 << 1,  /* none used in the last 10 frames */
    PLR_REASON_GATE_LOCKED = 1 << 2,      /* most matches rejected in 10 successive frames */
    PLR_REASON_GATE_INERT = 1 << 3,       /* 0 of the last 1000 matches rejected: gate too wide? */
    PLR_REASON_BLOCK_FAILED = 1 << 4,     /* an innovation covariance could not be factorised */
    PLR_REASON_SINK_FAILED = 1 << 5,      /* the map sink refused a landmark */
    PLR_REASON_NO_ROOM = 1 << 6,          /* new landmarks found no slot */
    PLR_REASON_REFUSED_INPUT = 1 << 7,    /* observations were malformed or ids were doubled */
    PLR_REASON_NIS_HIGH = 1 << 8,         /* innovations are larger than the noise explains */
    PLR_REASON_RANGE_LIMITED = 1 << 9,    /* an update pushed a landmark beyond max-range */
    PLR_REASON_NOT_POSITIVE = 1 << 10,    /* a variance ceased to be positive: diverged */
    PLR_REASON_BUDGET = 1 << 11           /* observations were left out for want of time */
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
    uint16_t reasons;       /* bits of plr_reason */
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
    uint16_t nis_dof;       /* degrees of freedom of nis */
    float nis;              /* sum of the gate distances d^2 of those accepted, left out or not */
} plr_report;

#endif
