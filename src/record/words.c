// SPDX-License-Identifier: MIT
#include "pelorus/filter.h"

/* A sentence for a number. */
typedef struct plr_words {
    int number;
    const char *text;
} plr_words;

#define STATUS(status, text) {status, text},
#define HEALTH(health, text)
#define REASON(reason, text)
#define IMU_FAULT(fault, text)
static const plr_words statuses[] = {
#include "record/words.def"
};

#undef STATUS
#undef HEALTH
#define STATUS(status, text)
#define HEALTH(health, text) {health, text},
static const plr_words healths[] = {
#include "record/words.def"
};

#undef HEALTH
#undef REASON
#define HEALTH(health, text)
#define REASON(reason, text) {reason, text},
static const plr_words reasons[] = {
#include "record/words.def"
};

#undef REASON
#undef IMU_FAULT
#define REASON(reason, text)
#define IMU_FAULT(fault, text) {fault, text},
static const plr_words imu_faults[] = {
#include "record/words.def"
};

#define LENGTH(table) (sizeof(table) / sizeof *(table))

static const char *find(const plr_words *words, size_t n, int number, const char *otherwise) {
    for (size_t i = 0; i < n; i++)
        if (words[i].number == number)
            return words[i].text;
    return otherwise;
}

const char *plr_status_text(plr_status status) {
    return find(statuses, LENGTH(statuses), (int)status, "no status of this version");
}

const char *plr_reason_text(plr_reason reason) {
    return find(reasons, LENGTH(reasons), (int)reason, "no reason of this version");
}

const char *plr_health_text(plr_health health) {
    return find(healths, LENGTH(healths), (int)health, "no health of this version");
}

const char *plr_imu_fault_text(plr_imu_fault fault) {
    return find(imu_faults, LENGTH(imu_faults), (int)fault, "no fault of this version");
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
