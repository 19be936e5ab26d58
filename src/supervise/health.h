// SPDX-License-Identifier: MIT
/* How far the estimate may be trusted, from what happened in the last frames and what comes now. */
#ifndef PLR_SUPERVISE_HEALTH_H
#define PLR_SUPERVISE_HEALTH_H

#include "pelorus/supervisor.h"

/* True if the last reading is too old to say how the body moves now. */
bool plr_health_readings_are_old(const plr_supervisor *s, const plr_readings_evidence *now);

/* What readings of odometry and of small sensors have to say: bits of plr_reason. */
uint32_t plr_health_of_readings(const plr_supervisor *s, const plr_readings_evidence *now);

/* The reasons by which the pose is lost at a time. A position that was used not long ago does for the pose
 * what the camera does not. */
uint32_t plr_health_lost_by(const plr_supervisor *s, plr_time_ns now_ns);

plr_health plr_health_of(uint32_t reasons, uint32_t lost_by);

/* Seconds from one time to another; 0 if that is earlier, infinite where there was none. */
static inline double plr_health_seconds(plr_time_ns then, plr_time_ns now) {
    if (then == PLR_NEVER_NS)
        return (double)__builtin_inf();
    return now < then ? 0 : (double)(now - then) * 1e-9;
}

/* How long ago the last frame, observation and reading were. */
static inline void plr_health_ages(const plr_supervisor *s, const plr_readings_evidence *now,
                                   plr_health_state *health) {
    health->seconds_without_frame = plr_health_seconds(s->last_frame_ns, now->now_ns);
    health->seconds_without_use = plr_health_seconds(s->last_use_ns, now->now_ns);
    health->seconds_without_twist =
        plr_health_seconds(now->valid ? now->reading_ns : PLR_NEVER_NS, now->now_ns);
}

#endif
