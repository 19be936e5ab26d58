// SPDX-License-Identifier: MIT
#include "pelorus/filter.h"

const char *plr_status_text(plr_status status) {
    switch (status) {
    case PLR_OK:
        return "good";
    case PLR_E_ARGUMENT:
        return "an argument is impossible: a null pointer, a matrix that is no rotation or no "
               "covariance, or more observations than PLR_MAX_OBSERVATIONS";
    case PLR_E_CONFIG:
        return "a setting makes no sense; plr_config_check names it";
    case PLR_E_CALIBRATION:
        return "the calibration makes no sense: focal lengths and baseline must be positive, T_CB "
               "a rigid motion";
    case PLR_E_NOT_FINITE:
        return "a number is NaN or infinite";
    case PLR_E_RANGE:
        return "a value is out of range: a step of more than pi rad or 1 km, or a landmark on the "
               "camera or beyond max-range";
    case PLR_E_TIME:
        return "time repeats or goes back; it must ascend";
    case PLR_E_LATE:
        return "the frame is older than the last twist; hold twists back for a late camera "
               "(setting twist-delay)";
    case PLR_E_GAP:
        return "time jumps forward by more than the setting max-gap; set the pose anew to go on";
    case PLR_E_MODE:
        return "the call does not belong to the mode in force";
    case PLR_E_FULL:
        return "no slot is free, or a device is too small for the state";
    case PLR_E_EXISTS:
        return "the state holds a landmark of this id already";
    case PLR_E_DIVERGED:
        return "a variance is not positive: there is no covariance to tell or to save";
    case PLR_E_NOT_READY:
        return "not initialised yet";
    case PLR_E_CPU:
        return "the processor flushes subnormal numbers to zero; switch that mode off";
    case PLR_E_CORRUPT:
        return "stored bytes fail their check";
    case PLR_E_FOREIGN:
        return "it comes from another version or build; a saved state fits one calibration and one "
               "set of settings, too";
    case PLR_E_IO:
        return "the port, the map sink or the storage reports a failure";
    case PLR_E_DAMAGED:
        return "the filter's memory does not hold what it should: initialise it again";
    case PLR_E_SIZE:
        return "program and library were compiled with other sizes: PLR_REAL, PLR_MAX_LANDMARKS, "
               "PLR_MAX_OBSERVATIONS and PLR_BLOCK_OBSERVATIONS must be the same";
    }
    return "no status of this version";
}

const char *plr_reason_text(plr_reason reason) {
    switch (reason) {
    case PLR_REASON_FEW_OBSERVATIONS:
        return "fewer than 3 observations used";
    case PLR_REASON_NO_OBSERVATIONS:
        return "no observation used in the last 10 frames";
    case PLR_REASON_GATE_LOCKED:
        return "the gate rejected most matches in 10 successive frames; their landmarks were "
               "dropped";
    case PLR_REASON_GATE_INERT:
        return "the gate rejected none of 1000 matches: is it too wide?";
    case PLR_REASON_BLOCK_FAILED:
        return "an innovation covariance could not be factorised";
    case PLR_REASON_SINK_FAILED:
        return "the map sink refused a landmark";
    case PLR_REASON_NO_ROOM:
        return "new landmarks found no slot";
    case PLR_REASON_REFUSED_INPUT:
        return "observations were malformed, or an id stood twice";
    case PLR_REASON_NIS_HIGH:
        return "innovations are larger than the noise explains: is pixel-sigma too small?";
    case PLR_REASON_RANGE_LIMITED:
        return "a landmark's correction was stopped: more than 1 rad, or nearer than 1 cm";
    case PLR_REASON_NOT_POSITIVE:
        return "a variance ceased to be positive";
    case PLR_REASON_BUDGET:
        return "observations were left out for want of time";
    case PLR_REASON_TWIST_CONTRADICTED:
        return "vision contradicts the twists (slipping wheels, a dead encoder?); vision's word "
               "was "
               "taken";
    case PLR_REASON_POSE_MAY_BE_WRONG:
        return "the pose may be wrong by more than its covariance says, until what was "
               "contradicted "
               "agrees again or the pose is set";
    case PLR_REASON_BIAS_OFF_PRIOR:
        return "a bias is beyond 3 sigma of its prior: do stereo and odometry disagree in scale?";
    case PLR_REASON_NIS_LOW:
        return "innovations are far smaller than the noise says: is pixel-sigma too large?";
    case PLR_REASON_FROZEN_IMAGE:
        return "the same pixels in successive frames while the twists go on: is the camera frozen?";
    case PLR_REASON_SCENE_DISAGREES:
        return "the matched points do not agree on one motion: does the scene move?";
    case PLR_REASON_RECOVERED:
        return "the landmarks were dropped and the covariance widened, to go on";
    case PLR_REASON_NO_FRAMES:
        return "no frame was used for too long: does the camera send?";
    case PLR_REASON_STATE_DAMAGED:
        return "the filter's memory was changed by something else";
    case PLR_REASON_NO_TWISTS:
        return "twists are missing, refused or held for too long: does the odometry send?";
    case PLR_REASON_READINGS_REJECTED:
        return "readings of a wheel, a standstill or a position are rejected: frame, arm, units, "
               "sigma?";
    }
    return "no reason of this version";
}

const char *plr_health_text(plr_health health) {
    switch (health) {
    case PLR_HEALTH_GOOD:
        return "good";
    case PLR_HEALTH_DEGRADED:
        return "degraded";
    case PLR_HEALTH_LOST:
        return "lost";
    case PLR_HEALTH_DIVERGED:
        return "diverged";
    }
    return "no health of this version";
}

const char *plr_version(void) {
    return "0.1.0";
}

/* FNV-1a over what the bits of a result depend on. */
uint32_t plr_build_fingerprint(void) {
    static const uint32_t parts[] = {
        PLR_VERSION_NUMBER, PLR_ARITHMETIC,       PLR_REAL,
        PLR_MAX_LANDMARKS,  PLR_MAX_OBSERVATIONS, PLR_BLOCK_OBSERVATIONS};
    uint32_t hash = 2166136261U;
    for (unsigned i = 0; i < sizeof parts / sizeof *parts; i++)
        for (unsigned byte = 0; byte < 4; byte++)
            hash = (hash ^ (parts[i] >> (8 * byte) & 0xFFU)) * 16777619U;
    return hash ? hash : 1;
}
