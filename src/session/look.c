// SPDX-License-Identifier: MIT
#include "session/look.h"

#include "session/events.h"
#include "session/line.h"
#include "session/send.h"
#include "session/use.h"

/* What is said once in a drive: bits of plr_eyes.told. */
enum {
    TOLD_CAMERAS = 1 << 0,
    TOLD_SIZE = 1 << 1,
    TOLD_FULL = 1 << 2,
    TOLD_BROKEN = 1 << 3,
    TOLD_UNPAIRED = 1 << 4,
    TOLD_SWAPPED = 1 << 5,
    TOLD_APART = 1 << 6,
    TOLD_FAULTS = 8 /* from this bit on those of plr_picture_fault, left and then right */
};

/* Halves that differ by more than this, s, and by five sigma. */
#define APART_S 2e-3F

static void tell(plr_session *s, uint32_t bit, const char *words) {
    if (s->options.eyes->told & bit)
        return;
    s->options.eyes->told |= bit;
    plr_send_words(s, PLR_SEVERITY_WARNING, words);
}

/* --- refusals --- */

static void refuse(plr_session *s, plr_time_ns t_ns, plr_status status) {
    const plr_eyes *eyes = s->options.eyes;
    plr_send_refusal(s, PLR_KIND_IMAGE, t_ns, status, NULL);
    if (eyes->status != PLR_OK)
        tell(s, TOLD_CAMERAS,
             "the cameras of the pictures make no sense: without a RIG the HEADER must have their "
             "size; HEADER's baseline must be the RIG's, and a build has a largest picture "
             "(PLR_VISION_PIXELS)");
    else if (status == PLR_E_ARGUMENT)
        tell(s, TOLD_SIZE,
             "a picture is of another size than its calibration: calibrate at this size, or send "
             "pictures of that one");
    else if (status == PLR_E_FULL)
        tell(s, TOLD_FULL, "a picture is larger than the memory that was given for it");
    else if (status == PLR_E_CORRUPT && eyes->totals.unpaired > 0)
        tell(s, TOLD_UNPAIRED, "a picture came without its other half, and is left out");
    else if (status == PLR_E_CORRUPT)
        tell(s, TOLD_BROKEN,
             "bands of a picture are missing or out of order, and it is left out: is the link too "
             "slow, or is its sender?");
}

/* --- what a pair shows --- */

static void tell_side(plr_session *s, uint8_t faults, const char *side, unsigned shift) {
    static const char *const words[] = {
        " picture is dark: a lens cap, no light, or too short an exposure?",
        " picture is overexposed: too long an exposure, or the sun?",
        " picture shows no contrast: a covered lens, fog, or a wall without texture?",
        " picture is the last one again: does the camera still send?"};
    for (unsigned i = 0; i < sizeof words / sizeof words[0]; i++) {
        const uint32_t bit = UINT32_C(1) << (TOLD_FAULTS + shift + i);
        if (!(faults >> i & 1) || s->options.eyes->told & bit)
            continue;
        s->options.eyes->told |= bit;
        plr_line_begin(&s->out.as.text, PLR_SEVERITY_WARNING, side);
        plr_line_text(&s->out.as.text, words[i]);
        plr_send_text(s);
    }
}

static void tell_halves(plr_session *s, const plr_vision_report *report) {
    const float apart = report->halves_apart_s, late = apart < 0 ? -apart : apart;
    if (!(report->halves_sigma_s > 0) || late < APART_S || late < 5 * report->halves_sigma_s ||
        s->options.eyes->told & TOLD_APART)
        return;
    s->options.eyes->told |= TOLD_APART;
    plr_line_begin(&s->out.as.text, PLR_SEVERITY_WARNING, "the right picture is taken ");
    plr_line_number(&s->out.as.text, (double)late * 1e3);
    plr_line_text(&s->out.as.text, apart < 0 ? " ms before" : " ms after");
    plr_line_text(&s->out.as.text, " what its time says: trigger both cameras together, or give "
                                   "each picture its own time");
    plr_send_text(s);
}

static void tell_report(plr_session *s, const plr_vision_report *report) {
    tell_side(s, report->left, "the left", 0);
    tell_side(s, report->right, "the right", 4);
    tell_halves(s, report);
    if (report->swapped)
        tell(s, TOLD_SWAPPED, "left and right pictures are exchanged: swap them, or the RIG");
}

/* --- a pair --- */

/* With twists the velocity is told; with an IMU it is estimated. */
static bool place_is_known(const plr_session *s) {
    double P[36];
    if (plr_filter_config(&s->filter)->process != PLR_PROCESS_IMU)
        return true;
    if (plr_filter_velocity_covariance(&s->filter, P) != PLR_OK)
        return false;
    for (unsigned i = 0; i < 3; i++)
        if (!(P[7 * i] < PLR_EYES_SPEED_SIGMA * PLR_EYES_SPEED_SIGMA))
            return false;
    return true;
}

plr_status plr_look_at(plr_session *s, const plr_picture_pair *pair) {
    plr_eyes *eyes = s->options.eyes;
    plr_frame frame;
    const plr_status status = eyes->calls->look(eyes, pair, place_is_known(s), &frame);
    if (status != PLR_OK) {
        refuse(s, pair->left.t_ns, status);
        return status;
    }
    tell_report(s, &eyes->vision.report);
    s->in.kind = PLR_KIND_STEREO;
    s->in.as.stereo = frame;
    plr_use_limit(s, &s->in.as.stereo);
    plr_send_echo(s);
    plr_events_take_stereo(s);
    return PLR_OK;
}

/* --- messages --- */

void plr_look_take_rig(plr_session *s) {
    plr_eyes *eyes = s->options.eyes;
    if (eyes == NULL)
        return;
    eyes->rig = s->in.as.rig;
    eyes->has_rig = true;
}

void plr_look_take(plr_session *s) {
    plr_eyes *eyes = s->options.eyes;
    plr_picture_pair pair;
    if (eyes == NULL) {
        if (s->totals.images == 1)
            plr_send_refusal(s, PLR_KIND_IMAGE, s->in.as.image.t_ns, PLR_E_MODE, NULL);
        return;
    }
    const plr_status status = eyes->calls->take(eyes, &s->in.as.image, &pair);
    if (status != PLR_OK && (eyes->status == PLR_OK || s->totals.images == 1))
        refuse(s, s->in.as.image.t_ns, status);
    if (pair.left.pixels != NULL)
        (void)plr_look_at(s, &pair);
}
