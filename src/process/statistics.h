// SPDX-License-Identifier: MIT
/*
 * How the readings of twists or of an IMU usually come: their interval, by how much successive ones
 * differ, and how they scatter about their mean. What a reading misses while others are lost is judged
 * by it, and whether one is a spike.
 */
#ifndef PLR_PROCESS_STATISTICS_H
#define PLR_PROCESS_STATISTICS_H

#include "pelorus/belief.h"
#include "pelorus/source.h"

/* The squared differences from the last reading, of the linear and of the angular three numbers. */
void plr_statistics_change(const plr_source *source, const plr_real reading[PLR_POSE_DIM],
                           plr_real change2[2]);

/* Learns from the next reading, `interval` seconds after the last one. */
void plr_statistics_learn(const plr_belief *belief, plr_source *source, plr_time_ns t_ns,
                          const plr_real reading[PLR_POSE_DIM], plr_real interval,
                          const plr_real change2[2]);

#endif
