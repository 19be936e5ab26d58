// SPDX-License-Identifier: MIT
/*
 * Wheels beside an IMU (docs/MATH.md 18). A wheel is known by its place. What all are wrong by, the share of
 * their radius and of the distance between them, are two errors of the calibration (state/calibration.h): a
 * reading is corrected by what is estimated of them, and tells how it depends on what is left.
 */
#ifndef PLR_PROCESS_WHEELS_H
#define PLR_PROCESS_WHEELS_H

#include <stdbool.h>

#include "pelorus/belief.h"
#include "pelorus/camera.h"
#include "pelorus/source.h"
#include "state/rows.h"

/* Notes where a reading's wheel sits, and whether it stands. */
void plr_wheels_note(plr_source *source, const plr_reading *reading);

/* True if the last reading noted may be used; `passed` says that the gate accepted its residual r, m/s. A
 * wheel slips once the gate has rejected six of its readings in succession. Without pictures the pose then
 * grows uncertain, and the gate wide: a reading that passes is used only if it is nearer to the estimate than
 * to the slip as it was followed, or ten seconds after the slip began. */
bool plr_wheels_hold(plr_source *source, const plr_real r[PLR_ROWS], bool passed);

/* True, and noted, if all wheels have read exactly zero for half a second, once each tenth of a second. */
bool plr_wheels_stand(plr_source *source, plr_time_ns t_ns);

/* A body that can neither slide nor rise: the axes that the reading does not measure read 0 with this sigma,
 * m/s. 0: nothing is added. */
void plr_wheels_deny_slide(plr_reading *reading, double sigma_mps);

/* The reading by scale and track as they are estimated. */
void plr_wheels_correct(const plr_source *source, const plr_camera_model *camera,
                        plr_reading *reading);

/* How r = z - M u of a corrected reading depends on the errors that are left. The rows that `measured` names are
 * those of the wheels themselves. */
void plr_wheels_differentiate(const plr_belief *belief, const plr_source *source,
                              const plr_camera_model *camera, const plr_reading *reading,
                              uint8_t measured, const plr_real z[PLR_ROWS],
                              const plr_real r[PLR_ROWS], plr_by_wheel *by);

#endif
