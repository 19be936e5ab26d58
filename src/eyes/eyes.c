// SPDX-License-Identifier: MIT
#include "pelorus/eyes.h"

#include <string.h>

#include "eyes/expect.h"

/* By what share HEADER's baseline may differ from that of the rig. */
#define SAME_BASELINE 1e-3

/* --- the cameras --- */

static bool same_lens(const plr_lens *a, const plr_lens *b) {
    enum { NUMBERS = sizeof(plr_lens) - offsetof(plr_lens, fx_px) };
    return a->model == b->model && a->width_px == b->width_px && a->height_px == b->height_px &&
           memcmp(&a->fx_px, &b->fx_px, NUMBERS) == 0;
}

static bool same_rig(const plr_eyes *e, const plr_rig *rig) {
    const plr_rig *own = &e->rig;
    return e->has_rig && same_lens(&own->left, &rig->left) && same_lens(&own->right, &rig->right) &&
           memcmp(&own->T_RL, &rig->T_RL, sizeof rig->T_RL) == 0 &&
           memcmp(&own->row_time_s, &rig->row_time_s, sizeof rig->row_time_s) == 0 &&
           own->disparity_max_px == rig->disparity_max_px && own->tracks == rig->tracks;
}

/* The rectified pair that HEADER tells. */
static void rig_of_header(plr_rig *rig, const plr_header *header) {
    const plr_calibration *c = &header->calibration;
    memset(rig, 0, sizeof *rig);
    rig->left.width_px = header->image_width_px;
    rig->left.height_px = header->image_height_px;
    rig->left.fx_px = c->fx_px, rig->left.fy_px = c->fy_px;
    rig->left.cx_px = c->cx_px, rig->left.cy_px = c->cy_px;
    rig->right = rig->left;
    for (int i = 0; i < 9; i += 4)
        rig->T_RL.R[i] = 1;
    rig->T_RL.p[0] = -c->baseline_m;
}

/* Eyes that see in HEADER's camera. */
static plr_status open(plr_eyes *e, const plr_header *header) {
    const plr_calibration *c = &header->calibration;
    plr_rig rig = e->has_rig ? e->rig : e->own;
    if (!e->has_rig && !e->has_own)
        rig_of_header(&rig, header);
    rig.fx_px = c->fx_px, rig.fy_px = c->fy_px;
    rig.cx_px = c->cx_px, rig.cy_px = c->cy_px;
    if (rig.tracks == 0 || rig.tracks > PLR_MAX_OBSERVATIONS)
        rig.tracks =
            PLR_VISION_TRACKS < PLR_MAX_OBSERVATIONS ? PLR_VISION_TRACKS : PLR_MAX_OBSERVATIONS;
    plr_calibration told;
    plr_status status = plr_vision_init(&e->vision, &rig);
    if (status == PLR_OK)
        status = plr_vision_calibration(&e->vision, &e->T_CB, &told);
    if (status != PLR_OK)
        return status;
    const double differs = told.baseline_m - c->baseline_m, most = SAME_BASELINE * c->baseline_m;
    return differs <= most && -differs <= most ? PLR_OK : PLR_E_CALIBRATION;
}

static void begin(plr_eyes *e, const plr_header *header, double camera_offset_s) {
    e->T_CB = header->calibration.T_CB;
    e->camera_offset_s = camera_offset_s;
    e->status = open(e, header);
}

/* --- bands --- */

/* Between the halves of a pair: less than half a picture's time at 25 Hz. */
#define APART_NS UINT64_C(20000000)

static void clear(plr_eyes *e) {
    memset(&e->totals, 0, sizeof e->totals);
    memset(&e->motion, 0, sizeof e->motion);
    e->has_rig = false;
    e->status = PLR_E_NOT_READY;
    e->told = 0;
    for (int side = 0; side < 2; side++) {
        e->halves[side].there = 0;
        e->halves[side].broken = false;
    }
}

static uint32_t pixels_of(const plr_eyes *e) {
    return (uint32_t)e->vision.width * e->vision.height;
}

/* The picture is dropped; of its other bands none is refused. */
static plr_status drop(plr_eyes *e, plr_eyes_half *half, const plr_image_message *band,
                       plr_status why) {
    e->totals.broken++;
    half->broken = true;
    half->there = 0;
    half->t_ns = band->t_ns;
    return why;
}

/* A picture begins. PLR_E_CORRUPT if the last one of this side did not end, or had no other half. */
static plr_status begin_half(plr_eyes *e, plr_eyes_half *half, plr_time_ns t_ns) {
    const bool unpaired = half->there == pixels_of(e), cut = half->there > 0 && !unpaired;
    e->totals.unpaired += unpaired;
    e->totals.broken += cut;
    half->there = 0;
    half->broken = false;
    half->t_ns = t_ns;
    return unpaired || cut ? PLR_E_CORRUPT : PLR_OK;
}

static plr_status add(plr_eyes *e, plr_eyes_half *half, const plr_image_message *band) {
    plr_status status = PLR_OK;
    if (half->broken && half->t_ns == band->t_ns)
        return PLR_OK;
    if (band->width_px != e->vision.width || band->height_px != e->vision.height)
        return drop(e, half, band, PLR_E_ARGUMENT);
    if (pixels_of(e) > e->capacity)
        return drop(e, half, band, PLR_E_FULL);
    if (band->first_px == 0)
        status = begin_half(e, half, band->t_ns);
    if (band->first_px != half->there || band->t_ns != half->t_ns ||
        band->count > pixels_of(e) - half->there)
        return drop(e, half, band, PLR_E_CORRUPT);
    memcpy(half->pixels + half->there, band->pixels, band->count);
    half->there += band->count;
    return status;
}

static plr_picture picture_of(const plr_eyes *e, const plr_eyes_half *half) {
    const plr_picture picture = {half->pixels, e->vision.width, e->vision.width, e->vision.height,
                                 half->t_ns};
    return picture;
}

/* Two whole pictures that belong together; of two that do not the older is dropped. */
static bool complete(plr_eyes *e) {
    plr_eyes_half *left = &e->halves[PLR_SIDE_LEFT], *right = &e->halves[PLR_SIDE_RIGHT];
    if (left->there != pixels_of(e) || right->there != pixels_of(e))
        return false;
    plr_eyes_half *older = left->t_ns < right->t_ns ? left : right;
    const plr_eyes_half *newer = older == left ? right : left;
    if (newer->t_ns - older->t_ns <= APART_NS)
        return true;
    e->totals.unpaired++;
    older->there = 0;
    return false;
}

static plr_status take(plr_eyes *e, const plr_image_message *band, plr_picture_pair *pair) {
    pair->left.pixels = NULL;
    if (e->status != PLR_OK)
        return e->status;
    const plr_status status = add(e, &e->halves[band->side], band);
    if (!complete(e))
        return status;
    pair->left = picture_of(e, &e->halves[PLR_SIDE_LEFT]);
    pair->right = picture_of(e, &e->halves[PLR_SIDE_RIGHT]);
    e->halves[PLR_SIDE_LEFT].there = e->halves[PLR_SIDE_RIGHT].there = 0;
    return status;
}

/* --- a pair --- */

/* The pair's time by the clock of the steps: that of the middle row. */
static plr_time_ns step_time(const plr_eyes *e, plr_time_ns t_ns) {
    const double rows_s = (double)e->vision.row_time * (e->vision.height - 1) / 2;
    const double moved_ns = (e->camera_offset_s + rows_s) * 1e9;
    const plr_time_ns by = (plr_time_ns)(moved_ns < 0 ? -moved_ns : moved_ns);
    if (moved_ns < 0)
        return t_ns > by ? t_ns - by : 0;
    return t_ns + by;
}

static plr_status look(plr_eyes *e, const plr_picture_pair *pair, bool place_known,
                       plr_frame *frame) {
    if (e->status != PLR_OK)
        return e->status;
    plr_eyes_motion moved = e->motion;
    memset(&e->expected, 0, sizeof e->expected);
    const bool known = plr_eyes_motion_take(&moved, step_time(e, pair->left.t_ns), &e->T_CB,
                                            place_known, &e->expected);
    const plr_status status =
        plr_vision_track(&e->vision, pair, known ? &e->expected : NULL, frame);
    e->totals.refused += status != PLR_OK;
    if (status != PLR_OK)
        return status;
    e->motion = moved;
    e->totals.pairs++;
    e->totals.faults += (e->vision.report.left | e->vision.report.right) != 0;
    return PLR_OK;
}

static void moved(plr_eyes *e, plr_time_ns t_ns, const plr_twist *velocity) {
    plr_eyes_motion_step(&e->motion, t_ns, velocity);
}

/* --- life --- */

plr_status plr_eyes_init_sized(plr_eyes *e, uint8_t *left, uint8_t *right, uint32_t capacity,
                               const plr_vision_sizes *caller) {
    static const plr_eyes_calls calls = {clear, same_rig, begin, moved, take, look};
    const plr_vision_sizes own = plr_vision_sizes_here((uint32_t)sizeof(plr_eyes));
    if (!e || !caller || (capacity > 0 && (!left || !right)))
        return PLR_E_ARGUMENT;
    if (memcmp(&own, caller, sizeof own) != 0)
        return PLR_E_SIZE;
    memset(e, 0, sizeof *e);
    e->calls = &calls;
    e->capacity = capacity;
    e->halves[PLR_SIDE_LEFT].pixels = left;
    e->halves[PLR_SIDE_RIGHT].pixels = right;
    e->status = PLR_E_NOT_READY;
    return PLR_OK;
}

plr_status plr_eyes_set_rig(plr_eyes *e, const plr_rig *rig) {
    if (!e || !rig)
        return PLR_E_ARGUMENT;
    e->own = *rig;
    e->has_own = true;
    return PLR_OK;
}
