// SPDX-License-Identifier: MIT
#include "pelorus/filter.h"

/* A function for each enum: a program that never calls one does not carry its sentences. */
#define STATUS(status, text)
#define HEALTH(health, text)
#define REASON(reason, text)
#define IMU_FAULT(fault, text)
#define SENTENCE(number, text)                                                                     \
    case number:                                                                                   \
        return text;

const char *plr_status_text(plr_status status) {
    switch (status) {
#undef STATUS
#define STATUS SENTENCE
#include "record/words.def"
#undef STATUS
#define STATUS(status, text)
    }
    return "no status of this version";
}

const char *plr_reason_text(plr_reason reason) {
    switch (reason) {
#undef REASON
#define REASON SENTENCE
#include "record/words.def"
#undef REASON
#define REASON(reason, text)
    }
    return "no reason of this version";
}

const char *plr_health_text(plr_health health) {
    switch (health) {
#undef HEALTH
#define HEALTH SENTENCE
#include "record/words.def"
#undef HEALTH
#define HEALTH(health, text)
    }
    return "no health of this version";
}

const char *plr_imu_fault_text(plr_imu_fault fault) {
    switch (fault) {
#undef IMU_FAULT
#define IMU_FAULT SENTENCE
#include "record/words.def"
    case PLR_IMU_FAULTS:
        break;
    }
    return "no fault of this version";
}

const char *plr_version(void) {
    return "0.1.0";
}

/* FNV-1a over what the bits of a result depend on. */
uint32_t plr_build_fingerprint(void) {
    static const uint32_t parts[] = {PLR_VERSION_NUMBER,
                                     PLR_ARITHMETIC,
                                     PLR_REAL,
                                     PLR_MAX_LANDMARKS,
                                     PLR_MAX_OBSERVATIONS,
                                     PLR_BLOCK_OBSERVATIONS,
                                     2 * PLR_SUPERVISE + PLR_KNOWN_MAP};
    uint32_t hash = 2166136261U;
    for (unsigned i = 0; i < sizeof parts / sizeof *parts; i++)
        for (unsigned byte = 0; byte < 4; byte++)
            hash = (hash ^ (parts[i] >> (8 * byte) & 0xFFU)) * 16777619U;
    return hash ? hash : 1;
}
