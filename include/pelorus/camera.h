// SPDX-License-Identifier: MIT
/* A part of the filter's memory (state.h): the stereo camera in the filter's precision, as it was given and as it is
 * estimated. For the library alone; a caller describes the camera by plr_calibration in types.h. */
#ifndef PELORUS_CAMERA_H
#define PELORUS_CAMERA_H

#include "pelorus/config.h"

typedef struct plr_camera {
    plr_real fx, fy, cx, cy; /* px */
    plr_real baseline;       /* m */
    plr_real R_CB[9];        /* body to left camera: q_C = R_CB s_B + t_CB */
    plr_real t_CB[3];        /* m */
} plr_camera;

/* The errors of the calibration that have a column of S: first those that are estimated, then those
 * that are considered. */
typedef struct plr_error_columns {
    uint8_t kind[PLR_CALIBRATIONS]; /* plr_calibration_error */
    uint8_t count, estimated;
    plr_real variance[PLR_CALIBRATIONS]; /* of the prior */
} plr_error_columns;

/* What has become of the calibration: src/state/calibration.h. */
typedef struct plr_camera_estimate {
    plr_camera eye; /* the camera as estimated; R_CB, t_CB: from the axes that `given` gives it to
                       where it was at the time of the last frame */
    plr_real R[9], t[3];               /* the same without the clock's part */
    plr_real twist[PLR_POSE_DIM];      /* of the camera at the last frame, m/s and rad/s */
    plr_real mean_twist[PLR_POSE_DIM]; /* the mean of it over the offset of the camera's clock */
    uint32_t moves; /* 0: by all that is known the body rests, and nothing is learnt */
    plr_real moved[PLR_CALIBRATIONS];  /* by how much each has been corrected */
    uint8_t misfits[PLR_CALIBRATIONS]; /* frames that would have moved each too far; 10: refused */
    /* Of the errors' covariance G D G^T: G, a lower triangle of ones on its diagonal, row k the column
     * of error k; and D beside the prior's variances. */
    plr_real factor[PLR_CALIBRATIONS * PLR_CALIBRATIONS], told[PLR_CALIBRATIONS];
    /* By twists: what successive frames say of each, summed up, older ones weighted less; the variance
     * of that sum if their errors are white; and its mean square beside that variance. */
    plr_real sum[PLR_CALIBRATIONS], sum_variance[PLR_CALIBRATIONS], usual[PLR_CALIBRATIONS];
    plr_real usual_frames; /* from which that was learnt */
    plr_real excess; /* the largest that is usual, 1 or more: what is learnt counts 1/excess */
    /* From here on readings change it. */
    plr_real rate[3], rate_variance; /* of the gyro, smoothed, bias included, rad/s; of an axis */
    /* Of the process, the last one first: seconds, and the rate, bias included, rad/s. */
    plr_real step[PLR_CLOCK_STEPS][4];
} plr_camera_estimate;

/* The camera: what init was given, and from `estimate` on what has become of it. Of sigmas the squares. */
typedef struct plr_camera_model {
    plr_camera given;
    plr_real Ad_CB[PLR_POSE_SQUARE]; /* Ad(T_CB): body twists to the camera */
    plr_real pixel_variance;         /* px^2 */
    plr_real track_drift_variance;   /* by which tracks wander in a second, px^2/s */
    plr_real min_disparity, max_row_gap;
    plr_real min_depth, max_depth, min_inverse_range;
    plr_real landmark_variance; /* of a new landmark, m^2; 0: by the pixels' */
    uint8_t landmark_prior;     /* plr_landmark_prior, of a new landmark in `world` */
    plr_error_columns errors;
    plr_camera_estimate estimate;
} plr_camera_model;

#endif
