// SPDX-License-Identifier: MIT
#include "sensor/kept.h"

#include <string.h>

#include "pelorus/assertions.h"
#include "state/blocks.h"
#include "state/covariance.h"

enum { BY_POSE = PLR_ROWS * PLR_POSE_DIM }; /* elements of a derivative by the pose */

void plr_measurement_keep(const plr_belief *belief, plr_workspace *work, unsigned slot,
                          const plr_measurement *m) {
    plr_sightings *frame = &work->sightings;
    plr_linearised *kept = &frame->of_slot[slot];
    const plr_term *own = &m->H.term[0], *pose = &m->H.term[1];
    (void)belief; /* the assertions alone ask it */
    PLR_ASSERT(own->row == plr_covariance_row(belief, slot) && own->columns == PLR_LANDMARK_DIM);
    PLR_ASSERT(slot < belief->count);
    memcpy(kept->H, own->H, sizeof kept->H);
    memcpy(kept->r, m->r, sizeof kept->r);
    memcpy(frame->R, m->R, sizeof frame->R);
    frame->terms = (uint8_t)m->H.terms;
    if (m->H.terms == 1)
        return;
    PLR_ASSERT(pose->row == plr_row_of(belief, PLR_BLOCK_POSE) && pose->columns == PLR_POSE_DIM);
    PLR_ASSERT(!work->noise.open);
    memcpy(work->noise.Wt + BY_POSE * slot, pose->H, BY_POSE * sizeof *pose->H);
}

void plr_measurement_recall(const plr_belief *belief, const plr_workspace *work, unsigned slot,
                            plr_measurement *m) {
    const plr_sightings *frame = &work->sightings;
    const plr_linearised *kept = &frame->of_slot[slot];
    PLR_ASSERT(slot < belief->count);
    m->H.terms = 0;
    plr_real *own = plr_rows_add(&m->H, plr_covariance_row(belief, slot), PLR_LANDMARK_DIM);
    memcpy(own, kept->H, sizeof kept->H);
    memcpy(m->r, kept->r, sizeof m->r);
    memcpy(m->R, frame->R, sizeof m->R);
    m->extra_d2 = m->residual2 = m->max_variance = 0;
    if (frame->terms == 1)
        return;
    plr_real *pose = plr_rows_add(&m->H, plr_row_of(belief, PLR_BLOCK_POSE), PLR_POSE_DIM);
    memcpy(pose, work->noise.Wt + BY_POSE * slot, BY_POSE * sizeof *pose);
}
