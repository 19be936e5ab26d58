// SPDX-License-Identifier: MIT
#include "pelorus/filter.h"

/* A sentence for a number of one of these enums. */
typedef enum plr_words_of { OF_STATUS, OF_HEALTH, OF_REASON, OF_IMU_FAULT } plr_words_of;

#define STATUS(status, text)   {OF_STATUS, (int)(status), text},
#define HEALTH(health, text)   {OF_HEALTH, (int)(health), text},
#define REASON(reason, text)   {OF_REASON, (int)(reason), text},
#define IMU_FAULT(fault, text) {OF_IMU_FAULT, (int)(fault), text},
static const struct {
    plr_words_of of;
    int number;
    const char *text;
} words[] = {
#include "record/words.def"
};

static const char *find(plr_words_of of, int number, const char *otherwise) {
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (words[i].of == of && words[i].number == number)
            return words[i].text;
    return otherwise;
}

const char *plr_status_text(plr_status status) {
    return find(OF_STATUS, (int)status, "no status of this version");
}

const char *plr_reason_text(plr_reason reason) {
    return find(OF_REASON, (int)reason, "no reason of this version");
}

const char *plr_health_text(plr_health health) {
    return find(OF_HEALTH, (int)health, "no health of this version");
}

const char *plr_imu_fault_text(plr_imu_fault fault) {
    return find(OF_IMU_FAULT, (int)fault, "no fault of this version");
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
