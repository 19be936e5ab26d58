// SPDX-License-Identifier: MIT
/*
 * The camera's calibration, estimated on the way (docs/MATH.md 20).
 *
 * The state's error is x + S s: x as P says, s the errors of the calibration, S the sensitivity. x is
 * filtered as if s were zero, and what a correction leaves of its residuals tells s: the two-stage
 * filter of Friedland (Treatment of Bias in Recursive Filtering, 1969), which for errors that are
 * constant gives what one filter of x and s together gives. So the calibration has no rows in P. What
 * is not in the setting `calibrate` is considered: it has a column in S, and nothing is learnt of it.
 */
#ifndef PLR_STATE_CALIBRATION_H
#define PLR_STATE_CALIBRATION_H

#include <stdbool.h>

#include "pelorus/belief.h"
#include "pelorus/camera.h"
#include "pelorus/settings.h"
#include "pelorus/source.h"
#include "pelorus/workspace.h"

/* How many errors are estimated. Where a build has room for none the compiler sees that, and leaves out what
 * estimates them. */
static inline unsigned plr_calibration_estimated(const plr_error_columns *errors) {
    return PLR_MAX_CALIBRATION > 0 ? errors->estimated : 0U;
}

/* The column of S of this kind of error; errors->count: it has none. */
static inline unsigned plr_calibration_column(const plr_error_columns *errors, unsigned kind) {
    unsigned k = 0;
    while (k < errors->count && errors->kind[k] != kind)
        k++;
    return k;
}

/* By how much it has been corrected: 0 where it has no column. */
static inline plr_real plr_calibration_moved(const plr_camera_model *camera, unsigned kind) {
    const unsigned k = plr_calibration_column(&camera->errors, kind);
    return k < camera->errors.count ? camera->estimate.moved[k] : PLR_R(0);
}

/* Lays out the columns of S by the settings. */
void plr_calibration_lay_out(plr_error_columns *to, const plr_config *config);

/* The calibration as it was given to init. */
void plr_calibration_reset(plr_camera_model *camera);

/* A reading of the gyro, body axes, bias included. By its own noise a body at rest would seem to turn, and
 * the camera's clock to show: the rate is smoothed as the readings' statistics allow. */
void plr_calibration_note_rate(plr_camera_model *camera, const plr_source *source,
                               const plr_real w_B[3]);

/* A step of the process by a mean reading: the last of them lead back to where a late camera was. */
void plr_calibration_note_step(plr_camera_model *camera, const plr_real reading[PLR_POSE_DIM],
                               plr_real seconds);

/* True if a part is estimated, or the camera's clock considered. */
bool plr_calibration_needs_twist(const plr_camera_model *camera);

/* Notes how the camera moves at the time of this frame, and where that puts it by its clock. twist_B is
 * the body's with its covariance as the process has it, and `change` that of its v in a second. What is not
 * beyond three of its sigmas counts as rest: noise moves the prediction, and it would seem as if the
 * pictures told something of that motion. A frame at rest teaches nothing. */
void plr_calibration_at_frame(const plr_belief *belief, plr_camera_model *camera,
                              const plr_source *source, const plr_real twist_B[PLR_POSE_DIM],
                              const plr_real change[3], const plr_real P_u[PLR_POSE_SQUARE]);

/* From the body to the camera as it is estimated, and where it was at the time of the last frame. */
void plr_calibration_place(const plr_camera_model *camera, plr_real R[9], plr_real t[3]);

/* The camera as it is if each estimated error is ds. */
void plr_calibration_correct(plr_camera_model *camera, const plr_real *ds);

/* The camera as it was given to init. */
void plr_calibration_put_back(plr_camera_model *camera);

/* True if estimated error k is refused. */
bool plr_calibration_refuses(const plr_camera_model *camera, unsigned k);

/* Nothing is known but the prior; the estimate stays. */
void plr_calibration_forget(plr_camera_model *camera);

/* False if what a saved state holds of it is no covariance. */
bool plr_calibration_is_sound(const plr_camera_model *camera);

/* After a divergence: what is known of it may be what has broken down. The estimate stays if its prior
 * allows it, as well known as it was at first. */
void plr_calibration_doubt(plr_camera_model *camera);

/* Nothing is learnt yet from the correction that begins: work.learnt. */
void plr_calibration_begin(const plr_camera_model *camera, plr_learnt *learnt);

/* Takes off what its batches say of the motion's noise, once eta_of_S and eta are multiplied by
 * U^-T, Lambda = U^T U. */
void plr_calibration_marginalise(const plr_camera_model *camera, plr_workspace *work);

/* Corrects the calibration by what was learnt, and the state with it: dx += S ds. A number that would move
 * farther than that allows is put back, and refused. */
void plr_calibration_learn(const plr_belief *belief, plr_camera_model *camera, plr_workspace *work);

/* The calibration with its sigmas. */
void plr_calibration_tell(const plr_belief *belief, const plr_camera_model *camera,
                          const plr_source *source, plr_calibration_result *told);

/* True if an error is refused: it would have moved farther than what was learnt of it allows. */
bool plr_calibration_is_off(const plr_camera_model *camera);

#endif
