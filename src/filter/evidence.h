// SPDX-License-Identifier: MIT
/* What the supervisor is told of a frame (pelorus/supervisor.h), in evidence. */
#ifndef PLR_FILTER_EVIDENCE_H
#define PLR_FILTER_EVIDENCE_H

#include <stdbool.h>

#include "filter/correction.h"
#include "filter/motion_first.h"
#include "pelorus/state.h"
#include "state/motion.h"

/* A pose, to be compared with the one after the correction. */
typedef struct plr_evidence_pose {
    plr_real R_WB[9];
    double p_WB[3];
} plr_evidence_pose;

/* How many observations show the very pixels of last time, and the motion since. */
void plr_evidence_of_picture(plr_filter *f, const plr_sightings *sightings);

void plr_evidence_note_pose(const plr_filter *f, plr_evidence_pose *pose);

/* After a correction: the motion by pictures beside that by odometry. `stated` is the odometry's, with the
 * sigmas that it states, `weight` the factor of these that the frame used; `by_odometry` the pose by it. */
void plr_evidence_of_motion(plr_filter *f, const plr_evidence_pose *by_odometry,
                            const plr_applied_motion *stated, plr_real weight,
                            const plr_motion_first *first, const plr_correction *correction);

/* Before the correction by a frame: true if it sees known landmarks, and `before` is filled. After it: what
 * they did to the pose. */
bool plr_evidence_before_map(plr_filter *f, const plr_sightings *sightings,
                             plr_evidence_pose *before);
void plr_evidence_after_map(plr_filter *f, const plr_evidence_pose *before);

/* At the end of a frame: biases and readings; and rows that the gate rejected find their landmarks again,
 * which births may have moved, for plr_filter_supervision. */
void plr_evidence_complete(plr_filter *f, plr_sightings *sightings);

#endif
