// SPDX-License-Identifier: MIT
#include "session/inputs.h"

#include "session/line.h"
#include "session/send.h"

static void count(plr_session *s) {
    switch (s->in.kind) {
    case PLR_KIND_TWIST:
        s->totals.twists++;
        break;
    case PLR_KIND_STEREO:
        s->totals.stereos++;
        break;
    case PLR_KIND_TRUTH:
        s->totals.truths++;
        break;
    case PLR_KIND_LANDMARK:
        s->totals.landmarks++;
        break;
    default:
        break;
    }
}

/* ", 10 of 12 TWIST" if that is how many arrived. */
static bool tell_missing(plr_text *line, const char *what, uint32_t sent, uint32_t received) {
    if (sent == received)
        return false;
    plr_line_words(line, ", ");
    plr_line_count(line, received);
    plr_line_words(line, " of ");
    plr_line_count(line, sent);
    plr_line_words(line, what);
    return true;
}

/* END says how many there were. */
static void compare_counts(plr_session *s) {
    const plr_end *end = &s->in.as.end;
    const plr_session_totals *received = &s->totals;
    plr_text *line = &s->out.as.text;
    plr_line_begin(line, PLR_SEVERITY_WARNING);
    plr_line_words(line, "the recording is not complete: not everything arrived");
    bool differs = tell_missing(line, " TWIST", end->twists, received->twists);
    differs |= tell_missing(line, " STEREO", end->stereos, received->stereos);
    differs |= tell_missing(line, " TRUTH", end->truths, received->truths);
    differs |= tell_missing(line, " LANDMARK", end->landmarks, received->landmarks);
    if (differs)
        plr_send_text(s);
}

bool plr_take_message(plr_session *s) {
    count(s);
    switch (s->in.kind) {
    case PLR_KIND_HEADER:
        plr_take_header(s);
        break;
    case PLR_KIND_CONFIG:
        plr_take_config(s);
        break;
    case PLR_KIND_START:
        plr_take_start(s);
        break;
    case PLR_KIND_TWIST:
        plr_take_twist(s);
        break;
    case PLR_KIND_STEREO:
        plr_take_stereo(s);
        break;
    case PLR_KIND_TRUTH:
        plr_take_truth(s);
        break;
    case PLR_KIND_LANDMARK:
        plr_take_landmark(s);
        break;
    case PLR_KIND_TEXT:
        plr_take_text(s);
        break;
    case PLR_KIND_STATE:
        plr_take_state(s);
        break;
    case PLR_KIND_END:
        compare_counts(s);
        return true;
    case PLR_KIND_POSE:   /* what another filter computed: not for this one */
    case PLR_KIND_REPORT: /* likewise */
    case PLR_KIND_NONE:
        break;
    }
    return false;
}
