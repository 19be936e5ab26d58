// SPDX-License-Identifier: MIT
#include "record/messages.h"

#include "pelorus/assertions.h"

#include <string.h>

/* A pixel, as a row of its message. */
typedef struct plr_grey {
    uint8_t grey;
} plr_grey;

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
#define COLUMNS(name, type)                                                                        \
    }                                                                                              \
    ;                                                                                              \
    static const plr_field name##_columns[] = {
#define COLUMN(name, type, member, kind_, since, unit, about)                                      \
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
#undef COLUMNS
#undef COLUMN
#undef END
#define MESSAGE(name, from, about) [PLR_KIND_##name] = {name##_fields, LENGTH(name##_fields)},
#define FIELD(name, member, kind, count, least, most, since, unit, about)
#define ROWS(name, type)
#define ROW(name, type, member, kind, unit, about)
#define COLUMNS(name, type)
#define COLUMN(name, type, member, kind, since, unit, about)
#define END(name)

static const plr_record records[PLR_WIRE_KINDS + 1] = {
#include "record/messages.def"
};

/* No row can be refused, so CHECK passes over them. */
static void pass_rows(plr_codec *c, unsigned count, void *rows, size_t size,
                      const plr_field *fields, unsigned n) {
    for (unsigned i = 0; i < count && c->status == PLR_OK && c->direction != PLR_CODEC_CHECK; i++)
        plr_codec_fields(c, (unsigned char *)rows + i * size, fields, n);
}

/* Sigmas come behind the observations, where one has its own. */
static void pass_sigmas(plr_codec *c, unsigned count, plr_observation *rows) {
    bool there = plr_codec_reads(c) && c->left > 0;
    if (c->status != PLR_OK)
        return;
    for (unsigned i = 0; i < count; i++) {
        if (plr_codec_reads(c))
            rows[i].sigma_px = 0;
        else
            there = there || rows[i].sigma_px != 0;
    }
    if (there)
        pass_rows(c, count, rows, sizeof *rows, STEREO_columns, LENGTH(STEREO_columns));
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
    pass_rows(c, m->count, rows, sizeof *rows, STEREO_rows, LENGTH(STEREO_rows));
    pass_sigmas(c, m->count, rows);
}

/* What is not in the frame: both pictures are of one size, and HEADER has the virtual camera. */
static void pass_rest_of_rig(plr_rig *rig) {
    rig->right.width_px = rig->left.width_px;
    rig->right.height_px = rig->left.height_px;
    rig->fx_px = rig->fy_px = rig->cx_px = rig->cy_px = 0;
}

void plr_message_pass(plr_codec *c, plr_kind kind, void *content,
                      const plr_observation_room *room) {
    if (kind == PLR_KIND_NONE || (unsigned)kind > PLR_WIRE_KINDS) {
        plr_codec_fail(c, PLR_E_FOREIGN);
        return;
    }
    PLR_ASSERT(records[kind].count > 0);
    plr_codec_fields(c, content, records[kind].fields, records[kind].count);
    if (kind == PLR_KIND_STEREO)
        pass_observations(c, content, room);
    if (kind == PLR_KIND_CONFIG) {
        plr_config_message *m = content;
        pass_rows(c, m->count, m->settings, sizeof *m->settings, CONFIG_rows, LENGTH(CONFIG_rows));
    }
    if (kind == PLR_KIND_IMU) {
        plr_imu_message *m = content;
        pass_rows(c, m->count, m->readings, sizeof *m->readings, IMU_rows, LENGTH(IMU_rows));
    }
    if (kind == PLR_KIND_EVIDENCE) {
        plr_supervision *m = content;
        pass_rows(c, m->count, m->rejected, sizeof *m->rejected, EVIDENCE_rows,
                  LENGTH(EVIDENCE_rows));
    }
    if (kind == PLR_KIND_IMAGE) {
        plr_image_message *m = content;
        plr_codec_bytes(c, &m->pixels, m->count * plr_codec_size(IMAGE_rows, LENGTH(IMAGE_rows)));
    }
    if (kind == PLR_KIND_RIG && plr_codec_reads(c))
        pass_rest_of_rig(content);
    if (kind == PLR_KIND_LANDMARK && plr_codec_reads(c)) {
        plr_landmark_message *m = content;
        m->landmark.times_gated = 0;
        m->landmark.known = m->role == PLR_LANDMARK_KNOWN;
    }
}

plr_time_ns plr_message_time(const plr_message *message) {
    const plr_field *first = records[message->kind].fields;
    PLR_ASSERT(message->kind != PLR_KIND_NONE && (unsigned)message->kind <= PLR_WIRE_KINDS);
    plr_time_ns t_ns = 0;
    if (first->kind == PLR_FIELD_U64)
        memcpy(&t_ns, (const unsigned char *)&message->as + first->offset, sizeof t_ns);
    return t_ns;
}
