// SPDX-License-Identifier: MIT
#include "session/saving.h"

#include <string.h>

#include "pelorus/state_store.h"
#include "session/begin.h"
#include "session/inputs.h"
#include "session/line.h"
#include "session/plausible.h"
#include "session/reanchor.h"
#include "session/send.h"

/* ---------------------------------------------------------------- telling */

/* Why not, where the status alone would not say it. */
static const char *words(const plr_session *s, plr_state_action action, plr_status status) {
    if (s->options.store == NULL)
        return "there is no storage here";
    if (status == PLR_E_MODE && action == PLR_STATE_RESTORE && s->phase == PLR_PHASE_RUNNING)
        return "a drive is under way; END ends it";
    if (status == PLR_E_NOT_READY && action == PLR_STATE_SAVE)
        return "no data was taken yet, so there is nothing to save";
    if (status == PLR_E_FULL)
        return "the storage is too small";
    if (status == PLR_E_IO)
        return "the storage fails, or does not give back what was written";
    if (status == PLR_E_NOT_READY)
        return s->phase == PLR_PHASE_WAITING ? "a HEADER must come first"
                                             : "nothing was ever saved here";
    return plr_status_text(status);
}

static void refuse(plr_session *s, plr_state_action action, plr_time_ns t_ns, plr_status status) {
    plr_text *line = &s->out.as.text;
    plr_line_begin(line, PLR_SEVERITY_WARNING);
    plr_line_words(line, action == PLR_STATE_SAVE ? "state not saved: " : "state not restored: ");
    plr_line_words(line, words(s, action, status));
    if (status == PLR_E_FULL) {
        plr_line_words(line, ": it has ");
        plr_line_count(line, s->options.store->device.size);
        plr_line_words(line, " bytes, and ");
        plr_line_count(line, plr_state_store_needs(s->options.store, &s->filter));
        plr_line_words(line, " are needed");
    }
    plr_send_text(s);
    plr_send_refusal(s, PLR_KIND_STATE, t_ns, status, NULL);
}

/* "generation 3, 17 landmarks, 8612 bytes, of 12.345 s", and the slots that are damaged. */
static void tell(plr_session *s, const char *what, const plr_stored_state *stored,
                 plr_time_ns of_ns) {
    plr_text *line = &s->out.as.text;
    plr_line_begin(line, PLR_SEVERITY_INFO);
    plr_line_words(line, what);
    plr_line_words(line, ": generation ");
    plr_line_count(line, stored->generation);
    plr_line_words(line, ", ");
    plr_line_count(line, plr_filter_landmark_count(&s->filter));
    plr_line_words(line, " landmarks, ");
    plr_line_count(line, stored->length);
    plr_line_words(line, " bytes, of ");
    plr_line_time(line, of_ns);
    if (stored->damaged > 0)
        plr_line_words(line, "; the other slot holds a damaged one");
    plr_send_text(s);
}

/* ---------------------------------------------------------------- save */

/* Some data was taken: without any, a save would push out a state that is worth something. */
static bool has_data(const plr_session *s) {
    plr_totals totals;
    return s->phase == PLR_PHASE_RUNNING && plr_filter_totals(&s->filter, &totals) == PLR_OK &&
           (totals.twists > 0 || totals.frames > 0);
}

void plr_saving_save(plr_session *s, plr_time_ns t_ns) {
    plr_stored_state saved;
    plr_status status = PLR_E_MODE;
    if (s->options.store != NULL)
        status = has_data(s) ? plr_state_store_save(s->options.store, &s->filter, &saved)
                             : PLR_E_NOT_READY;
    if (status != PLR_OK) {
        refuse(s, PLR_STATE_SAVE, t_ns, status);
        return;
    }
    tell(s, "state saved", &saved, plr_filter_time(&s->filter));
    plr_send_answer(s, PLR_KIND_STATE, t_ns, PLR_OK);
}

/* ---------------------------------------------------------------- restore */

/* What came of a restore. */
typedef struct plr_restored {
    plr_stored_state stored;
    plr_time_ns of_ns; /* time of the state as it was saved */
} plr_restored;

static plr_status check_moved(const double variance[6]) {
    for (unsigned i = 0; i < 6; i++) {
        if (!(variance[i] - variance[i] == 0))
            return PLR_E_NOT_FINITE;
        if (variance[i] < 0)
            return PLR_E_ARGUMENT;
    }
    return plr_plausible_variance(variance, 6) ? PLR_OK : PLR_E_RANGE;
}

/* True if t_ns is later than the estimate by at most max-gap. */
static bool follows(const plr_filter *f, plr_time_ns t_ns) {
    const double max_gap_ns = plr_filter_config(f)->max_gap_s * 1e9;
    return t_ns >= plr_filter_time(f) && (double)(t_ns - plr_filter_time(f)) <= max_gap_ns;
}

/* Sets the clock to t_ns, and allows for what may have moved. Where nothing lies between, the last
 * reading still holds, and the next bits are those of a drive that was never interrupted. */
static plr_status go_on(plr_filter *f, plr_time_ns t_ns, const double variance[6]) {
    double P[36] = {0};
    bool moved = false;
    for (unsigned i = 0; i < 6; i++) {
        P[7 * i] = variance[i];
        moved = moved || variance[i] > 0;
    }
    if (!moved && follows(f, t_ns))
        return PLR_OK;
    return plr_filter_resume(f, t_ns, moved ? P : NULL);
}

/* The restored state is the start: nothing that came before it sets the pose. */
static void take_as_start(plr_session *s) {
    plr_totals totals;
    if (plr_filter_totals(&s->filter, &totals) == PLR_OK)
        s->start_resets = plr_send_resets(&totals);
    s->start_known = false;
    s->started = true;
    plr_clock_watch_init(&s->watch);
    memset(&s->last, 0, sizeof s->last);
    s->last.t_ns = UINT64_MAX; /* no frame of this session: the next one is not its double */
}

static plr_status may_restore(const plr_session *s, const double variance[6]) {
    if (s->phase == PLR_PHASE_WAITING)
        return PLR_E_NOT_READY;
    if (s->options.store == NULL || (s->phase == PLR_PHASE_RUNNING && !s->restored))
        return PLR_E_MODE;
    return check_moved(variance);
}

/* What STATE asks for; on an error the session waits for another start. */
static plr_status restore(plr_session *s, const plr_state_message *wanted, plr_restored *r) {
    plr_status status = may_restore(s, wanted->moved_variance);
    if (status != PLR_OK)
        return status;
    s->phase = PLR_PHASE_READY; /* a repeated STATE restores again */
    s->started = s->restored = false;
    if (!plr_begin_filter(s))
        return PLR_E_CONFIG;
    status = plr_state_store_restore(s->options.store, &s->filter, &r->stored);
    if (status != PLR_OK)
        return status;
    r->of_ns = plr_filter_time(&s->filter);
    return go_on(&s->filter, wanted->t_ns, wanted->moved_variance);
}

static void take_restore(plr_session *s) {
    const plr_state_message wanted = s->in.as.state;
    plr_restored r;
    const plr_status status = restore(s, &wanted, &r);
    if (status == PLR_OK) {
        plr_begin_announce(s);
        take_as_start(s);
        s->restored = true;
    }
    plr_send_echo(s); /* behind the CONFIG in force, as data: a log of it can be replayed */
    if (status != PLR_OK) {
        refuse(s, PLR_STATE_RESTORE, wanted.t_ns, status);
        return;
    }
    tell(s, "state restored", &r.stored, r.of_ns);
    plr_send_answer(s, PLR_KIND_STATE, wanted.t_ns, PLR_OK);
}

void plr_take_state(plr_session *s) {
    if (s->in.as.state.action == PLR_STATE_RESTORE) {
        take_restore(s);
        return;
    }
    plr_send_echo(s);
    plr_saving_save(s, s->in.as.state.t_ns);
}

void plr_saving_load(plr_session *s, plr_time_ns t_ns) {
    static const double stood_still[6];
    plr_filter *f = &s->filter;
    plr_restored r;
    plr_status status = PLR_E_MODE;
    if (s->options.store != NULL)
        status = plr_state_store_restore(s->options.store, f, &r.stored);
    if (status == PLR_OK) {
        r.of_ns = plr_filter_time(f);
        status = go_on(f, t_ns, stood_still);
        if (status != PLR_OK)
            (void)plr_filter_reset(f);
    }
    if (status != PLR_OK) {
        refuse(s, PLR_STATE_RESTORE, t_ns, status);
        return;
    }
    take_as_start(s);
    tell(s, "state restored", &r.stored, r.of_ns);
    plr_send_answer(s, PLR_KIND_STATE, t_ns, PLR_OK);
}
