// SPDX-License-Identifier: MIT
/*
 * The filter's state as bytes and back: docs/STATE-FORMAT.md, by the tables of snapshot.def. What
 * init derives from settings and calibration is not restored, but compared: a state belongs to the
 * filter that it was saved from.
 */
#include <string.h>

#include "filter/filter_internal.h"
#include "filter/guard.h"
#include "process/velocity.h"
#include "record/codec.h"
#include "state/calibration.h"
#include "state/covariance.h"
#include "supervise/supervise.h"

/* "PLRF" */
#define STATE_MAGIC 0x46524C50U

enum { STATE_VERSION = 18 };

/* ---------------------------------------------------------------- layout */

/* What must agree before anything else can be read. */
typedef struct plr_state_origin {
    uint32_t magic, version, build_fingerprint;
    uint8_t settings;
} plr_state_origin;

/* One for each row of the setting table. */
typedef struct plr_state_setting {
    uint8_t id;
    double value;
} plr_state_setting;

typedef struct plr_state_count {
    uint32_t landmarks;
} plr_state_count;

/* Of the filter, in between: what is read is looked at before it is stored. */
typedef struct plr_state_pose {
    plr_real R_WB[9];
    double p_WB[3];
} plr_state_pose;

#define TABLE(name, times) static const plr_field name##_fields[] = {
#define GROUP(about)
#define FIELD(type, member, kind_, count_, most_, about)                                           \
    {.offset = offsetof(type, member),                                                             \
     .most = (most_),                                                                              \
     .kind = PLR_FIELD_##kind_,                                                                    \
     .count = (count_)},
#define END(name)                                                                                  \
    }                                                                                              \
    ;
#include "filter/snapshot.def"

/* Where one field stands for several members of a struct, they lie without a gap, or this does not
 * compile. */
enum {
    OF_CAMERA = 1 / (sizeof(plr_camera) == 17 * sizeof(plr_real)),
    OF_TOTALS = 1 / (offsetof(plr_totals, readings_refused) ==
                     offsetof(plr_totals, twists) + 16 * sizeof(uint32_t)),
    OF_SUMS = 1 / (offsetof(plr_totals, diverged_ns) + sizeof(plr_time_ns) ==
                   offsetof(plr_totals, observations) + 7 * sizeof(uint64_t))
};

/* All fields of a table, and their size as bytes. */
#define PASS(c, object, table)                                                                     \
    plr_codec_fields((c), (void *)(object), table##_fields,                                        \
                     sizeof table##_fields / sizeof *table##_fields)
#define SIZE(table) plr_codec_size(table##_fields, sizeof table##_fields / sizeof *table##_fields)

static uint32_t elements(const plr_filter *f, unsigned landmarks) {
    return (uint32_t)plr_covariance_size(&f->belief, landmarks);
}

/* Of one column of the sensitivity. */
static uint32_t rows(const plr_filter *f, unsigned landmarks) {
    return (uint32_t)plr_covariance_row(&f->belief, landmarks);
}

/* Behind the sensitivity: by how much each error has been corrected; the covariance's factor, a row of each
 * by those that are estimated; and of these D, how white their residuals are, and misfits. `f` NULL: it is skipped. */
static void pass_calibration(plr_codec *c, plr_filter *f, const plr_error_columns *errors) {
    plr_camera_estimate *to = f ? &f->camera.estimate : NULL;
    const unsigned estimated = plr_calibration_estimated(errors);
    plr_codec_numbers(c, PLR_FIELD_REAL, to ? to->moved : NULL, errors->count);
    for (unsigned k = 0; k < errors->count; k++)
        plr_codec_numbers(c, PLR_FIELD_REAL, to ? to->factor + PLR_CALIBRATIONS * k : NULL,
                          estimated);
    plr_codec_numbers(c, PLR_FIELD_REAL, to ? to->told : NULL, estimated);
    plr_codec_numbers(c, PLR_FIELD_REAL, to ? to->sum : NULL, estimated);
    plr_codec_numbers(c, PLR_FIELD_REAL, to ? to->sum_variance : NULL, estimated);
    plr_codec_numbers(c, PLR_FIELD_REAL, to ? to->usual : NULL, estimated);
    plr_codec_numbers(c, PLR_FIELD_U8, to ? to->misfits : NULL, estimated);
}

/* P, the sensitivity, and what has become of the calibration. */
static void pass_covariance(plr_codec *c, plr_filter *f) {
    plr_codec_numbers(c, PLR_FIELD_REAL, (void *)plr_covariance_elements(&f->belief),
                      elements(f, f->belief.count));
    for (unsigned k = 0; k < f->camera.errors.count; k++)
        plr_codec_numbers(c, PLR_FIELD_REAL, f->belief.S[k], rows(f, f->belief.count));
    pass_calibration(c, f, &f->camera.errors);
}

static uint32_t calibration_size(const plr_error_columns *errors) {
    const uint32_t estimated = plr_calibration_estimated(errors);
    return (errors->count * (1 + estimated) + 4 * estimated) * (uint32_t)sizeof(plr_real) +
           estimated;
}

uint32_t plr_filter_saved_size(const plr_filter *f, unsigned landmarks) {
    if (plr_guard_check(f) != PLR_OK || landmarks > f->config.slots)
        return 0;
    return SIZE(origin) + plr_setting_count() * SIZE(setting) + SIZE(camera) + SIZE(count) +
           SIZE(time) + SIZE(pose) + SIZE(filter) + landmarks * SIZE(slot) +
           (elements(f, landmarks) + f->camera.errors.count * rows(f, landmarks)) *
               (uint32_t)sizeof(plr_real) +
           calibration_size(&f->camera.errors);
}

/* What the state belongs to: build, settings, camera. */
static void pass_origin(plr_codec *c, const plr_filter *f) {
    const plr_state_origin here = {STATE_MAGIC, STATE_VERSION, plr_build_fingerprint(),
                                   (uint8_t)plr_setting_count()};
    PASS(c, &here, origin);
    for (unsigned i = 0; i < here.settings && !c->differs; i++) {
        const plr_setting *row = plr_setting_at(i);
        const plr_state_setting setting = {row->id, plr_config_get(&f->config, row)};
        PASS(c, &setting, setting);
    }
    if (!c->differs)
        PASS(c, &f->camera.given, camera);
}

/* ---------------------------------------------------------------- save */

/* Bytes on their way to the sink. */
typedef struct plr_state_out {
    plr_state_sink sink;
    void *context;
    uint8_t buffer[PLR_STATE_CHUNK];
    unsigned fill;
} plr_state_out;

static bool flush(plr_state_out *out) {
    const unsigned n = out->fill;
    out->fill = 0;
    return n == 0 || out->sink(out->context, out->buffer, n) == 0;
}

static bool to_sink(void *context, uint8_t *bytes, unsigned n) {
    plr_state_out *out = context;
    bool good = true;
    for (unsigned i = 0; i < n && good; i++) {
        out->buffer[out->fill++] = bytes[i];
        if (out->fill == sizeof out->buffer)
            good = flush(out);
    }
    return good;
}

plr_status plr_filter_save(const plr_filter *f, plr_state_sink sink, void *context) {
    const plr_status sound = plr_guard_check_whole(f);
    if (sound != PLR_OK)
        return sound;
    if (!plr_covariance_is_positive(&f->belief))
        return PLR_E_DIVERGED;
    plr_state_out out = {.sink = sink, .context = context};
    plr_codec c = {.direction = sink ? PLR_CODEC_WRITE : PLR_CODEC_CHECK,
                   .finite = true,
                   .move = to_sink,
                   .context = &out};
    const plr_state_count count = {f->belief.count};
    plr_state_pose pose;
    memcpy(pose.R_WB, f->belief.R_WB, sizeof pose.R_WB);
    memcpy(pose.p_WB, f->belief.p_WB, sizeof pose.p_WB);
    pass_origin(&c, f);
    PASS(&c, &count, count);
    PASS(&c, f, time);
    PASS(&c, &pose, pose);
    PASS(&c, f, filter);
    for (unsigned slot = 0; slot < f->belief.count; slot++)
        PASS(&c, &f->belief.slots[slot], slot);
    pass_covariance(&c, (plr_filter *)f);
    if (c.status == PLR_OK && !flush(&out))
        c.status = PLR_E_IO;
    return c.status;
}

/* ---------------------------------------------------------------- restore */

/* Bytes on their way from the source. */
typedef struct plr_state_in {
    plr_state_source source;
    void *context;
    uint32_t at, length; /* bytes taken from the source, and all that there are */
    uint8_t buffer[PLR_STATE_CHUNK];
    unsigned first, fill;
} plr_state_in;

static bool refill(plr_state_in *in) {
    const uint32_t left = in->length - in->at;
    in->fill = left < sizeof in->buffer ? (unsigned)left : (unsigned)sizeof in->buffer;
    in->first = 0;
    in->at += in->fill;
    return in->source(in->context, in->at - in->fill, in->buffer, in->fill) == 0;
}

/* The codec asks for no more than there is. */
static bool from_source(void *context, uint8_t *bytes, unsigned n) {
    plr_state_in *in = context;
    for (unsigned i = 0; i < n; i++) {
        if (in->first == in->fill && !refill(in))
            return false;
        bytes[i] = in->buffer[in->first++];
    }
    return true;
}

/* In bytes that were saved no number can be one that save refuses. */
static plr_status as_stored(const plr_codec *c) {
    return c->status == PLR_OK || c->status == PLR_E_IO ? c->status : PLR_E_CORRUPT;
}

/* Checks covariance and sensitivity without storing them: finite numbers, variances not negative. */
static plr_status check_covariance(plr_codec *c, unsigned dim, const plr_error_columns *errors) {
    for (unsigned i = 0; i < dim && c->status == PLR_OK; i++) {
        plr_real variance = 0;
        plr_codec_numbers(c, PLR_FIELD_REAL, NULL, i);
        plr_codec_numbers(c, PLR_FIELD_REAL, &variance, 1);
        if (c->status == PLR_OK && !(variance >= 0))
            return PLR_E_CORRUPT;
    }
    plr_codec_numbers(c, PLR_FIELD_REAL, NULL, errors->count * dim);
    pass_calibration(c, NULL, errors);
    return as_stored(c);
}

/* Reads the pose; f = NULL: only checks it. */
static plr_status read_pose(plr_codec *c, plr_filter *f) {
    plr_state_pose pose;
    PASS(c, &pose, pose);
    if (c->status == PLR_OK && !plr_guard_is_pose(pose.R_WB, pose.p_WB))
        return PLR_E_CORRUPT;
    if (f) {
        memcpy(f->belief.R_WB, pose.R_WB, sizeof f->belief.R_WB);
        memcpy(f->belief.p_WB, pose.p_WB, sizeof f->belief.p_WB);
    }
    return as_stored(c);
}

/* Reads one landmark, without its rows of P; f = NULL: only checks it. */
static plr_status read_slot(plr_codec *c, plr_filter *f, const plr_filter *like, unsigned number) {
    plr_slot slot;
    memset(&slot, 0, sizeof slot);
    PASS(c, &slot, slot);
    if (c->status == PLR_OK && !plr_guard_is_landmark(like, &slot))
        return PLR_E_CORRUPT;
    if (f)
        memcpy(&f->belief.slots[number], &slot, sizeof slot);
    return as_stored(c);
}

/* Reads the whole state. f = NULL: only checks it. `like` is the filter that it must
 * belong to. PLR_E_FOREIGN: of another build, of other settings, of another camera. */
static plr_status read_whole(plr_codec *c, plr_filter *f, const plr_filter *like) {
    plr_state_count count = {0};
    const size_t length = c->left;
    c->direction = PLR_CODEC_MATCH;
    pass_origin(c, like);
    c->direction = PLR_CODEC_READ;
    if (c->status == PLR_OK && c->differs)
        return PLR_E_FOREIGN;
    PASS(c, &count, count);
    if (c->status != PLR_OK)
        return as_stored(c);
    if (length !=
        plr_filter_saved_size(like, count.landmarks)) /* which is 0 if these are too many */
        return PLR_E_CORRUPT;
    PASS(c, f, time);
    plr_status status = read_pose(c, f);
    if (f)
        plr_calibration_forget(&f->camera);
    PASS(c, f, filter);
    if (f) {
        f->belief.count = count.landmarks;
        plr_velocity_forget(&f->source); /* their clock is not the one that goes on */
        memset(f->belief.slots, 0, sizeof f->belief.slots);
        plr_supervise_restored(&f->supervisor);
    }
    for (unsigned slot = 0; slot < count.landmarks && status == PLR_OK; slot++)
        status = read_slot(c, f, like, slot);
    if (status != PLR_OK)
        return status;
    if (!f)
        return check_covariance(c, plr_covariance_row(&like->belief, count.landmarks),
                                &like->camera.errors);
    pass_covariance(c, f);
    return plr_calibration_is_sound(&f->camera) ? as_stored(c) : PLR_E_CORRUPT;
}

plr_status plr_filter_restore(plr_filter *f, uint32_t length, plr_state_source source,
                              void *context) {
    const plr_status sound = source ? plr_guard_check(f) : PLR_E_ARGUMENT;
    if (sound != PLR_OK)
        return sound;
    const plr_state_in start = {.source = source, .context = context, .length = length};
    plr_state_in in = start;
    const plr_codec begin = {.finite = true, .move = from_source, .context = &in, .left = length};
    plr_codec c = begin;
    plr_status status = read_whole(&c, NULL, f);
    if (status != PLR_OK)
        return status;

    in = start;
    c = begin;
    status = read_whole(&c, f, f);
    if (status == PLR_OK)
        plr_guard_seal_whole(f);
    else
        (void)plr_filter_reset(f);
    return status;
}
