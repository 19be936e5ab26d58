// SPDX-License-Identifier: MIT
/* The measurements of a frame, linearised once and kept in the workspace until the correction. */
#ifndef PLR_SENSOR_KEPT_H
#define PLR_SENSOR_KEPT_H

#include "pelorus/belief.h"
#include "pelorus/workspace.h"
#include "sensor/measurement.h"

/* Keeps H, r and R of the measurement of a slot's landmark until the correction: rows by the
 * landmark and maybe the pose. In one frame all have the same R. */
void plr_measurement_keep(const plr_belief *belief, plr_workspace *work, unsigned slot,
                          const plr_measurement *m);

/* The measurement that was kept. What the gate alone needs is zero. */
void plr_measurement_recall(const plr_belief *belief, const plr_workspace *work, unsigned slot,
                            plr_measurement *m);

#endif
