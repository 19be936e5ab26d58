// SPDX-License-Identifier: MIT
#include "record/messages.h"

#include <string.h>

/* The fields of each message, and those of its rows. They are counted from the beginning of the
 * message's content, which all members of plr_message.as share. */
#define MESSAGE(name, from, about) static const plr_field name##_fields[] = {
#define FIELD(name, member, kind_, count_, least_, most_, since_, unit, about)                     \
    {.offset = offsetof(plr_message, as.member) - offsetof(plr_message, as),                       \
     .most = (most_),                                                                              \
     .kind = PLR_FIELD_##kind_,                                                                    \
     .count = (count_),                                                                            \
     .least = (least_),                                                                            \
     .since = (since_)},
#define ROWS(name, type)                                                                           \
    }                                                                                              \
    ;                                                                                              \
    static const plr_field name##_rows[] = {
#define ROW(name, type, member, kind_, unit, about)                                                \
    {.offset = offsetof(type, member), .kind = PLR_FIELD_##kind_, .count = 1},
#define END(name)                                                                                  \
    }                                                                                              \
    ;
#include "record/messages.def"

#define LENGTH(table) (sizeof(table) / sizeof *(table))

typedef struct plr_record {
    const plr_field *fields;
    unsigned count;
} plr_record;

#undef MESSAGE
#undef FIELD
#undef ROWS
#undef ROW
#undef END
#define MESSAGE(name, from, about) [PLR_KIND_##name] = {name##_fields, LENGTH(name##_fields)},
#define FIELD(name, member, kind, count, least, most, since, unit, about)
#define ROWS(name, type)
#define ROW(name, type, member, kind, unit, about)
#define END(name)

static const plr_record records[PLR_WIRE_KINDS + 1] = {
#include "record/messages.def"
};

/* No row can be refused, so CHECK passes over them. */
static unsigned rows_of(const plr_codec *c, unsigned count) {
    return c->direction == PLR_CODEC_CHECK ? 0 : count;
}

static void pass_settings(plr_codec *c, plr_config_message *m) {
    for (unsigned i = 0; i < rows_of(c, m->count) && c->status == PLR_OK; i++)
        plr_codec_fields(c, &m->settings[i], CONFIG_rows, LENGTH(CONFIG_rows));
}

static void pass_imu(plr_codec *c, plr_imu_message *m) {
    for (unsigned i = 0; i < rows_of(c, m->count) && c->status == PLR_OK; i++)
        plr_codec_fields(c, &m->readings[i], IMU_rows, LENGTH(IMU_rows));
}

static void pass_rejected(plr_codec *c, plr_supervision *m) {
    for (unsigned i = 0; i < rows_of(c, m->count) && c->status == PLR_OK; i++)
        plr_codec_fields(c, &m->rejected[i], EVIDENCE_rows, LENGTH(EVIDENCE_rows));
}

/* What is read goes to the reader's room; what is written is only looked at. */
static void pass_observations(plr_codec *c, plr_frame *m, const plr_observation_room *room) {
    plr_observation *rows = (plr_observation *)m->observations;
    if (plr_codec_reads(c)) {
        m->observations = rows = room->observations;
        if (m->count > room->most)
            plr_codec_fail(c, PLR_E_FULL);
    } else if (m->count > 0 && !rows) {
        plr_codec_fail(c, PLR_E_ARGUMENT);
    }
    for (unsigned i = 0; i < rows_of(c, m->count) && c->status == PLR_OK; i++)
        plr_codec_fields(c, &rows[i], STEREO_rows, LENGTH(STEREO_rows));
}

void plr_message_pass(plr_codec *c, plr_kind kind, void *content,
                      const plr_observation_room *room) {
    if (kind == PLR_KIND_NONE || (unsigned)kind > PLR_WIRE_KINDS) {
        plr_codec_fail(c, PLR_E_FOREIGN);
        return;
    }
    plr_codec_fields(c, content, records[kind].fields, records[kind].count);
    if (kind == PLR_KIND_CONFIG)
        pass_settings(c, content);
    if (kind == PLR_KIND_STEREO)
        pass_observations(c, content, room);
    if (kind == PLR_KIND_IMU)
        pass_imu(c, content);
    if (kind == PLR_KIND_EVIDENCE)
        pass_rejected(c, content);
    if (kind == PLR_KIND_LANDMARK && plr_codec_reads(c)) {
        plr_landmark_message *m = content;
        m->landmark.times_gated = 0;
        m->landmark.known = m->role == PLR_LANDMARK_KNOWN;
    }
}

plr_time_ns plr_message_time(const plr_message *message) {
    const plr_field *first = records[message->kind].fields;
    plr_time_ns t_ns = 0;
    if (first->kind == PLR_FIELD_U64)
        memcpy(&t_ns, (const unsigned char *)&message->as + first->offset, sizeof t_ns);
    return t_ns;
}
