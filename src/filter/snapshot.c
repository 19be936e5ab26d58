// SPDX-License-Identifier: MIT
/*
 * The filter's state as bytes and back: docs/STATE-FORMAT.md. What init derives from settings and
 * calibration is not carried, but compared: a state belongs to the filter that it was taken from.
 */
#include "filter/filter_internal.h"
#include "filter/guard.h"
#include "math/packed.h"
#include "record/fields.h"
#include "state/covariance.h"

/* "PLRF" */
#define STATE_MAGIC 0x46524C50U

enum { STATE_VERSION = 2 };

#define LENGTH(table) (sizeof(table) / sizeof *(table))
#define FIELD(type, member, kind, n)                                                               \
    { offsetof(type, member), kind, n }
#define OF_FILTER(member, kind, n)      FIELD(plr_filter, member, kind, n)
#define OF_CONSISTENCY(member, kind, n) FIELD(plr_filter, consistency.member, kind, n)
#define OF_CAMERA(member, n)            FIELD(plr_camera, member, PLR_FIELD_REAL, n)
#define OF_SLOT(member, kind, n)        FIELD(plr_slot, member, kind, n)
#define OF_TOTALS(member, kind)         OF_FILTER(totals.member, kind, 1)

/* ---------------------------------------------------------------- layout */

/* What must agree before anything else can be read. */
typedef struct plr_state_origin {
    uint32_t magic, version, build_fingerprint;
} plr_state_origin;

static const plr_field origin_fields[] = {
    FIELD(plr_state_origin, magic, PLR_FIELD_U32, 1),
    FIELD(plr_state_origin, version, PLR_FIELD_U32, 1),
    FIELD(plr_state_origin, build_fingerprint, PLR_FIELD_U32, 1),
};

static const plr_field u8_fields[] = {{0, PLR_FIELD_U8, 1}};
static const plr_field u32_fields[] = {{0, PLR_FIELD_U32, 1}};

/* One for each row of the setting table. */
typedef struct plr_state_setting {
    uint8_t id;
    double value;
} plr_state_setting;

static const plr_field setting_fields[] = {
    FIELD(plr_state_setting, id, PLR_FIELD_U8, 1),
    FIELD(plr_state_setting, value, PLR_FIELD_F64, 1),
};

static const plr_field camera_fields[] = {
    OF_CAMERA(fx, 1),       OF_CAMERA(fy, 1),   OF_CAMERA(cx, 1),   OF_CAMERA(cy, 1),
    OF_CAMERA(baseline, 1), OF_CAMERA(R_CB, 9), OF_CAMERA(t_CB, 3),
};

static const plr_field filter_fields[] = {
    OF_FILTER(t_ns, PLR_FIELD_U64, 1),
    OF_FILTER(reading_ns, PLR_FIELD_U64, 1),
    OF_FILTER(interval_s, PLR_FIELD_REAL, 1),
    OF_FILTER(clock_started, PLR_FIELD_FLAG, 1),
    OF_FILTER(reading_valid, PLR_FIELD_FLAG, 1),
    OF_FILTER(R_WB, PLR_FIELD_REAL, 9),
    OF_FILTER(p_WB, PLR_FIELD_F64, 3),
    OF_FILTER(bias, PLR_FIELD_REAL, PLR_BIAS_DIM),
    OF_FILTER(reading, PLR_FIELD_REAL, 6),
    OF_FILTER(motion.E, PLR_FIELD_REAL, 9),
    OF_FILTER(motion.p, PLR_FIELD_REAL, 3),
    OF_FILTER(motion.Q, PLR_FIELD_REAL, PLR_POSE_SQUARE),
    OF_FILTER(motion.B, PLR_FIELD_REAL, PLR_POSE_SQUARE),
    OF_FILTER(motion.seconds, PLR_FIELD_REAL, 1),
    OF_FILTER(motion.pending, PLR_FIELD_FLAG, 1),
    OF_FILTER(motion.noisy, PLR_FIELD_FLAG, 1),
    OF_FILTER(frame_number, PLR_FIELD_U32, 1),
    OF_FILTER(bias_prior, PLR_FIELD_REAL, PLR_BIAS_DIM),
    OF_FILTER(bias_prior_sigma, PLR_FIELD_REAL, PLR_BIAS_DIM),
    OF_FILTER(recovery_P, PLR_FIELD_REAL, PLR_POSE_TRIANGLE),
    OF_CONSISTENCY(windows[0].sum, PLR_FIELD_REAL, 6),
    OF_CONSISTENCY(windows[0].variance, PLR_FIELD_REAL, PLR_POSE_TRIANGLE),
    OF_CONSISTENCY(windows[1].sum, PLR_FIELD_REAL, 6),
    OF_CONSISTENCY(windows[1].variance, PLR_FIELD_REAL, PLR_POSE_TRIANGLE),
    OF_CONSISTENCY(windows[2].sum, PLR_FIELD_REAL, 6),
    OF_CONSISTENCY(windows[2].variance, PLR_FIELD_REAL, PLR_POSE_TRIANGLE),
    OF_CONSISTENCY(apart, PLR_FIELD_REAL, 6),
    OF_CONSISTENCY(apart_sigmas, PLR_FIELD_REAL, 6),
    OF_CONSISTENCY(apart_noise, PLR_FIELD_REAL, 1),
    OF_CONSISTENCY(still_way, PLR_FIELD_REAL, 6),
    OF_CONSISTENCY(still_variance, PLR_FIELD_REAL, 6),
    OF_CONSISTENCY(matched, PLR_FIELD_REAL, 1),
    OF_CONSISTENCY(gated, PLR_FIELD_REAL, 1),
    OF_CONSISTENCY(nis, PLR_FIELD_REAL, 1),
    OF_CONSISTENCY(nis_dof, PLR_FIELD_REAL, 1),
    OF_CONSISTENCY(agreeing, PLR_FIELD_U16, 1),
    OF_CONSISTENCY(excess, PLR_FIELD_REAL, 1),
    OF_CONSISTENCY(insisting, PLR_FIELD_U16, 1),
    OF_CONSISTENCY(slight, PLR_FIELD_U16, 1),
    OF_CONSISTENCY(contradicted, PLR_FIELD_FLAG, 1),
    OF_CONSISTENCY(drifting, PLR_FIELD_FLAG, 1),
    OF_CONSISTENCY(frozen, PLR_FIELD_FLAG, 1),
    OF_CONSISTENCY(doubtful, PLR_FIELD_FLAG, 1),
    OF_FILTER(health, PLR_FIELD_U8, 1),
    OF_FILTER(reasons, PLR_FIELD_U32, 1),
    OF_FILTER(last_frame_ns, PLR_FIELD_U64, 1),
    OF_FILTER(last_use_ns, PLR_FIELD_U64, 1),
    OF_FILTER(refused_before, PLR_FIELD_U32, 1),
    OF_FILTER(frames_without_use, PLR_FIELD_U16, 1),
    OF_FILTER(frames_mostly_gated, PLR_FIELD_U16, 1),
    OF_FILTER(matches_since_gated, PLR_FIELD_U32, 1),
    OF_TOTALS(twists, PLR_FIELD_U32),
    OF_TOTALS(frames, PLR_FIELD_U32),
    OF_TOTALS(late, PLR_FIELD_U32),
    OF_TOTALS(refused, PLR_FIELD_U32),
    OF_TOTALS(resets, PLR_FIELD_U32),
    OF_TOTALS(locks, PLR_FIELD_U32),
    OF_TOTALS(range_limited, PLR_FIELD_U32),
    OF_TOTALS(blocks_failed, PLR_FIELD_U32),
    OF_TOTALS(widened, PLR_FIELD_U32),
    OF_TOTALS(recoveries, PLR_FIELD_U32),
    OF_TOTALS(contradictions, PLR_FIELD_U32),
    OF_TOTALS(twists_refused, PLR_FIELD_U32),
    OF_TOTALS(frames_refused, PLR_FIELD_U32),
    OF_TOTALS(damaged, PLR_FIELD_U32),
    OF_TOTALS(observations, PLR_FIELD_U64),
    OF_TOTALS(matched, PLR_FIELD_U64),
    OF_TOTALS(used, PLR_FIELD_U64),
    OF_TOTALS(gated, PLR_FIELD_U64),
    OF_TOTALS(created, PLR_FIELD_U64),
    OF_TOTALS(evicted, PLR_FIELD_U64),
    OF_TOTALS(diverged_ns, PLR_FIELD_U64),
};

static const plr_field slot_fields[] = {
    OF_SLOT(x, PLR_FIELD_REAL, PLR_LANDMARK_DIM),
    OF_SLOT(beyond, PLR_FIELD_REAL, 1),
    OF_SLOT(id, PLR_FIELD_U32, 1),
    OF_SLOT(times_seen, PLR_FIELD_U32, 1),
    OF_SLOT(times_gated, PLR_FIELD_U32, 1),
    OF_SLOT(last_frame, PLR_FIELD_U32, 1),
    OF_SLOT(print, PLR_FIELD_U32, 1),
    OF_SLOT(last_seen_ns, PLR_FIELD_U64, 1),
    OF_SLOT(lean, PLR_FIELD_REAL, 3),
    OF_SLOT(lean_variance, PLR_FIELD_REAL, 1),
    OF_SLOT(known, PLR_FIELD_FLAG, 1),
    OF_SLOT(strays, PLR_FIELD_FLAG, 1),
    OF_SLOT(chances, PLR_FIELD_U8, 1),
    OF_SLOT(accepted, PLR_FIELD_U16, 1),
    OF_SLOT(rejected, PLR_FIELD_U16, 1),
};

/* n elements of P, which are carried here and not computed with: row i is i + 1 long. */
static plr_field reals(uint32_t n) {
    const plr_field field = {0, PLR_FIELD_REAL, n};
    return field;
}

static plr_state_origin origin(void) {
    const plr_state_origin here = {STATE_MAGIC, STATE_VERSION, plr_build_fingerprint()};
    return here;
}

static plr_state_setting setting_in_force(const plr_filter *f, unsigned index) {
    const plr_setting *setting = plr_setting_at(index);
    const plr_state_setting here = {setting->id, plr_config_get(&f->config, setting)};
    return here;
}

uint32_t plr_filter_saved_size(const plr_filter *f, unsigned landmarks) {
    if (!f || plr_guard_look(f) != PLR_OK || landmarks > f->config.slots)
        return 0;
    const plr_field P = reals((uint32_t)plr_packed_row(plr_covariance_row(f, landmarks)));
    return plr_fields_size(origin_fields, LENGTH(origin_fields)) + plr_fields_size(u32_fields, 1) +
           plr_fields_size(u8_fields, 1) +
           plr_setting_count() * plr_fields_size(setting_fields, LENGTH(setting_fields)) +
           plr_fields_size(camera_fields, LENGTH(camera_fields)) +
           plr_fields_size(filter_fields, LENGTH(filter_fields)) +
           landmarks * plr_fields_size(slot_fields, LENGTH(slot_fields)) + plr_fields_size(&P, 1);
}

/* ---------------------------------------------------------------- save */

static void put_belonging(plr_fields_out *out, const plr_filter *f) {
    const plr_state_origin here = origin();
    const uint8_t settings = (uint8_t)plr_setting_count();
    plr_fields_put(out, &here, origin_fields, LENGTH(origin_fields));
    plr_fields_put(out, &settings, u8_fields, 1);
    for (unsigned i = 0; i < settings; i++) {
        const plr_state_setting setting = setting_in_force(f, i);
        plr_fields_put(out, &setting, setting_fields, LENGTH(setting_fields));
    }
    plr_fields_put(out, &f->par.camera, camera_fields, LENGTH(camera_fields));
}

plr_status plr_filter_save(const plr_filter *f, plr_state_sink sink, void *context) {
    if (!f)
        return PLR_E_ARGUMENT;
    const plr_status sound = plr_guard_look_whole(f);
    if (sound != PLR_OK)
        return sound;
    if (f->diverged || !plr_covariance_is_positive(f))
        return PLR_E_DIVERGED;
    plr_fields_out out = {.sink = sink, .context = context, .status = PLR_OK};
    const uint32_t count = f->count;
    const plr_field P = reals((uint32_t)plr_packed_row(plr_covariance_dim(f)));
    put_belonging(&out, f);
    plr_fields_put(&out, &count, u32_fields, 1);
    plr_fields_put(&out, f, filter_fields, LENGTH(filter_fields));
    for (unsigned slot = 0; slot < f->count; slot++)
        plr_fields_put(&out, &f->slots[slot], slot_fields, LENGTH(slot_fields));
    plr_fields_put(&out, f->P, &P, 1);
    plr_fields_flush(&out);
    return out.status;
}

/* ---------------------------------------------------------------- restore */

/* PLR_OK, or PLR_E_FOREIGN: of another build, of other settings, of another camera. */
static plr_status read_belonging(plr_fields_in *in, const plr_filter *f) {
    const plr_state_origin here = origin();
    const uint8_t settings = (uint8_t)plr_setting_count();
    bool same = plr_fields_match(in, &here, origin_fields, LENGTH(origin_fields)) &&
                plr_fields_match(in, &settings, u8_fields, 1);
    for (unsigned i = 0; same && i < settings; i++) {
        const plr_state_setting setting = setting_in_force(f, i);
        same = plr_fields_match(in, &setting, setting_fields, LENGTH(setting_fields));
    }
    same = same && plr_fields_match(in, &f->par.camera, camera_fields, LENGTH(camera_fields));
    if (in->status != PLR_OK)
        return in->status;
    return same ? PLR_OK : PLR_E_FOREIGN;
}

/* The number of landmarks, which the length must agree with. */
static plr_status read_count(plr_fields_in *in, const plr_filter *f, unsigned *landmarks) {
    uint32_t count = 0;
    plr_fields_get(in, &count, u32_fields, 1);
    if (in->status != PLR_OK)
        return in->status;
    if (in->length != plr_filter_saved_size(f, count)) /* which is 0 if these are too many */
        return PLR_E_CORRUPT;
    *landmarks = count;
    return PLR_OK;
}

/* Looks at the rest, and keeps nothing: numbers finite, flags flags, variances not negative. */
static plr_status check_rest(plr_fields_in *in, const plr_filter *f, unsigned landmarks) {
    const unsigned dim = plr_covariance_row(f, landmarks);
    plr_fields_get(in, NULL, filter_fields, LENGTH(filter_fields));
    for (unsigned slot = 0; slot < landmarks; slot++)
        plr_fields_get(in, NULL, slot_fields, LENGTH(slot_fields));
    for (unsigned i = 0; i < dim && in->status == PLR_OK; i++) {
        const plr_field before = reals(i), last = reals(1);
        plr_real variance = 0;
        plr_fields_get(in, NULL, &before, 1);
        plr_fields_get(in, &variance, &last, 1);
        if (in->status == PLR_OK && !(variance >= 0))
            return PLR_E_CORRUPT;
    }
    return in->status;
}

static plr_status load_rest(plr_fields_in *in, plr_filter *f, unsigned landmarks) {
    plr_fields_get(in, f, filter_fields, LENGTH(filter_fields));
    f->count = landmarks;
    f->diverged = 0;
    for (unsigned slot = 0; slot < landmarks; slot++)
        plr_fields_get(in, &f->slots[slot], slot_fields, LENGTH(slot_fields));
    const plr_field P = reals((uint32_t)plr_packed_row(plr_covariance_dim(f)));
    plr_fields_get(in, f->P, &P, 1);
    return in->status;
}

plr_status plr_filter_restore(plr_filter *f, uint32_t length, plr_state_source source,
                              void *context) {
    if (!f || !source)
        return PLR_E_ARGUMENT;
    const plr_status sound = plr_guard_look(f);
    if (sound != PLR_OK)
        return sound;
    const plr_fields_in start = {
        .source = source, .context = context, .length = length, .status = PLR_OK};
    unsigned landmarks = 0;
    plr_fields_in in = start;
    plr_status status = read_belonging(&in, f);
    if (status == PLR_OK)
        status = read_count(&in, f, &landmarks);
    if (status == PLR_OK)
        status = check_rest(&in, f, landmarks);
    if (status != PLR_OK)
        return status;

    in = start;
    status = read_belonging(&in, f);
    if (status == PLR_OK)
        status = read_count(&in, f, &landmarks); /* of the length, so the same as before */
    if (status == PLR_OK)
        status = load_rest(&in, f, landmarks);
    if (status == PLR_OK)
        plr_guard_seal_whole(f);
    else
        (void)plr_filter_reset(f);
    return status;
}
