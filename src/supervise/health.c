// SPDX-License-Identifier: MIT
#include "supervise/health.h"

#include "limits/limits.h"
#include "supervise/readings.h"

bool plr_health_readings_are_old(const plr_supervisor *s, const plr_readings_evidence *now) {
    const double held = plr_health_seconds(now->reading_ns, now->now_ns);
    const double intervals = (double)plr_limit(s->left_out, PLR_LIMIT_HELD_INTERVALS);
    const double held_s = 1e-3 * (double)plr_limit(s->left_out, PLR_LIMIT_HELD_MS);
    return now->needed && (!now->valid || held > intervals * (double)now->interval_s + held_s);
}

uint32_t plr_health_of_readings(const plr_supervisor *s, const plr_readings_evidence *now) {
    const bool lacking =
        (now->needed && now->refused != s->refused_before) || plr_health_readings_are_old(s, now);
    uint32_t reasons = plr_sensors_are_wrong(s) ? PLR_REASON_READINGS_REJECTED : 0;
    if (lacking)
        reasons |= PLR_REASON_NO_TWISTS;
    if (!now->imu || !now->needed)
        return reasons;
    if (!now->started)
        reasons |= PLR_REASON_NOT_STARTED;
    if (now->unsettled)
        reasons |= PLR_REASON_POSE_MAY_BE_WRONG;
    if (now->fault_of_start || (now->fault_of_reading && lacking))
        reasons |= PLR_REASON_IMU_FAULT;
    return reasons;
}

uint32_t plr_health_lost_by(const plr_supervisor *s, plr_time_ns now_ns) {
    const uint32_t always = PLR_REASON_GATE_LOCKED | PLR_REASON_NOT_STARTED;
    const bool positioned = plr_health_seconds(s->last_position_ns, now_ns) <=
                            (double)plr_limit(s->left_out, PLR_LIMIT_POSITION_S);
    return positioned ? always : always | PLR_REASON_NO_OBSERVATIONS | PLR_REASON_NO_FRAMES;
}

plr_health plr_health_of(uint32_t reasons, uint32_t lost_by) {
    if (reasons & PLR_REASON_STATE_DAMAGED)
        return PLR_HEALTH_DIVERGED;
    if (reasons & lost_by)
        return PLR_HEALTH_LOST;
    return reasons & ~(uint32_t)PLR_REASONS_HARMLESS ? PLR_HEALTH_DEGRADED : PLR_HEALTH_GOOD;
}
