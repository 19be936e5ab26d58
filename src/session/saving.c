// SPDX-License-Identifier: MIT
#include "session/saving.h"

#include <string.h>

#include "math/finite.h"
#include "pelorus/state_store.h"
#include "session/line.h"
#include "session/phase.h"
#include "session/plausible.h"
#include "session/reanchor.h"
#include "session/send.h"
#include "session/start.h"

/* ---------------------------------------------------------------- answers */

/* Why not, where the status alone would not say it. */
static const char *reason(const plr_session *s, plr_state_action action, plr_status status) {
    if (s->options.store == NULL)
        return "there is no storage here";
    if (status == PLR_E_MODE && action == PLR_STATE_RESTORE && s->phase >= PLR_PHASE_STARTING)
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

void plr_saving_refuse(plr_session *s, plr_state_action action, plr_time_ns t_ns,
                       plr_status status) {
    plr_text *line = &s->out.as.text;
    plr_line_begin(line, PLR_SEVERITY_WARNING,
                   action == PLR_STATE_SAVE ? "state not saved: " : "state not restored: ");
    plr_line_text(line, reason(s, action, status));
    if (status == PLR_E_FULL) {
        plr_line_count(line, ": it has ", s->options.store->device.size);
        plr_line_count(line, " bytes, and ", plr_state_store_needs(s->options.store, &s->filter));
        plr_line_text(line, " are needed");
    }
    plr_send_text(s);
    plr_send_refusal(s, PLR_KIND_STATE, t_ns, status, NULL);
}

/* "state saved: generation 3, 17 landmarks, 8612 bytes, of 12.345 s", and whether the other slot is
 * damaged; of_ns is the time of the state, t_ns that of the REPORT. */
static void answer(plr_session *s, plr_notice notice, const plr_stored_state *stored,
                   plr_time_ns of_ns, plr_time_ns t_ns) {
    plr_text *line = &s->out.as.text;
    plr_line_begin(line, PLR_SEVERITY_INFO,
                   notice == PLR_NOTICE_SAVED ? "state saved" : "state restored");
    plr_line_count(line, ": generation ", stored->generation);
    plr_line_count(line, ", ", plr_filter_landmark_count(&s->filter));
    plr_line_count(line, " landmarks, ", stored->length);
    plr_line_text(line, " bytes, of ");
    plr_line_time(line, of_ns);
    if (stored->damaged > 0)
        plr_line_text(line, "; the other slot holds a damaged one");
    plr_send_text(s);
    plr_send_answer(s, PLR_KIND_STATE, t_ns, PLR_OK, notice);
}

/* ---------------------------------------------------------------- save */

/* Some data was used: without any, a save would push out a state that is worth something. */
static bool has_data(const plr_session *s) {
    plr_totals totals;
    return plr_filter_totals(&s->filter, &totals) == PLR_OK &&
           (totals.twists > 0 || totals.frames > 0);
}

void plr_saving_save(plr_session *s, plr_time_ns t_ns) {
    plr_stored_state saved;
    plr_status status = PLR_E_MODE;
    if (s->options.store != NULL)
        status = has_data(s) ? plr_state_store_save(s->options.store, &s->filter, &saved)
                             : PLR_E_NOT_READY;
    if (status == PLR_OK)
        answer(s, PLR_NOTICE_SAVED, &saved, plr_filter_time(&s->filter), t_ns);
    else
        plr_saving_refuse(s, PLR_STATE_SAVE, t_ns, status);
}

/* ---------------------------------------------------------------- restore */

static plr_status check_moved(const plr_state_message *wanted) {
    if (!plr_all_finite(wanted->moved_variance, 6))
        return PLR_E_NOT_FINITE;
    for (unsigned i = 0; i < 6; i++)
        if (wanted->moved_variance[i] < 0)
            return PLR_E_ARGUMENT;
    return plr_plausible(PLR_GROUP_RESTORE, wanted) ? PLR_OK : PLR_E_RANGE;
}

/* Sets the clock to t_ns, and allows for what may have moved. Where nothing lies between, the last
 * reading still applies, and the next bits are those of a drive that was never interrupted. */
static plr_status go_on(plr_session *s, plr_time_ns t_ns, const double variance[6]) {
    const plr_time_ns saved_ns = plr_filter_time(&s->filter);
    double P[36] = {0};
    bool moved = false;
    for (unsigned i = 0; i < 6; i++) {
        P[7 * i] = variance[i];
        moved = moved || variance[i] > 0;
    }
    if (!moved && t_ns >= saved_ns && t_ns - saved_ns <= plr_clock_max_gap_ns(s))
        return PLR_OK;
    return plr_filter_resume(&s->filter, t_ns, moved ? P : NULL);
}

/* What STATE asks for, or PLR_START_SAVED; *of_ns, if all is well, is the saved state's time. */
static plr_status load(plr_session *s, plr_time_ns t_ns, const double moved_variance[6],
                       plr_stored_state *stored, plr_time_ns *of_ns) {
    if (s->options.store == NULL)
        return PLR_E_MODE;
    plr_status status = plr_state_store_restore(s->options.store, &s->filter, stored);
    if (status != PLR_OK)
        return status;
    *of_ns = plr_filter_time(&s->filter);
    status = go_on(s, t_ns, moved_variance);
    if (status != PLR_OK)
        (void)plr_filter_reset(&s->filter);
    return status;
}

/* The restored state is the start: nothing that came before it sets the pose. */
static void start_from_state(plr_session *s, plr_phase_trigger trigger) {
    plr_send_resets_become(s, 0);
    s->start_pending = false;
    plr_phase_change(&s->phase, trigger);
    s->watch.agreeing = 0;
    memset(&s->last, 0, sizeof s->last);
    s->last.t_ns = UINT64_MAX; /* no frame of this session: the next one is not its double */
}

/* On an error the session waits for another start. */
static plr_status restore(plr_session *s, const plr_state_message *wanted, plr_stored_state *stored,
                          plr_time_ns *of_ns) {
    if (s->options.store == NULL)
        return PLR_E_MODE;
    const plr_status status = check_moved(wanted);
    if (status != PLR_OK)
        return status;
    plr_phase_change(&s->phase, PLR_TRIGGER_RESTORE);
    if (s->phase == PLR_PHASE_REJECTED || plr_start_filter(s) != PLR_OK)
        return PLR_E_CONFIG;
    return load(s, wanted->t_ns, wanted->moved_variance, stored, of_ns);
}

void plr_saving_restore(plr_session *s) {
    const plr_state_message wanted = s->in.as.state;
    plr_stored_state stored;
    plr_time_ns of_ns = 0;
    const plr_status status = restore(s, &wanted, &stored, &of_ns);
    if (status == PLR_OK) {
        plr_start_announce(s);
        start_from_state(s, PLR_TRIGGER_RESTORED);
    }
    plr_send_echo(s); /* behind the CONFIG in force, as data: a log of it can be replayed */
    if (status == PLR_OK)
        answer(s, PLR_NOTICE_RESTORED, &stored, of_ns, wanted.t_ns);
    else
        plr_saving_refuse(s, PLR_STATE_RESTORE, wanted.t_ns, status);
}

void plr_saving_restore_at_start(plr_session *s, plr_time_ns t_ns) {
    static const double stood_still[6];
    plr_stored_state stored;
    plr_time_ns of_ns = 0;
    const plr_status status = load(s, t_ns, stood_still, &stored, &of_ns);
    if (status != PLR_OK) {
        plr_saving_refuse(s, PLR_STATE_RESTORE, t_ns, status);
        return;
    }
    start_from_state(s, PLR_TRIGGER_POSE);
    answer(s, PLR_NOTICE_RESTORED, &stored, of_ns, t_ns);
}
