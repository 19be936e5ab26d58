// SPDX-License-Identifier: MIT
/* In the place of src/supervise where a build leaves it out (PLR_SUPERVISE=0): nothing is doubted, every
 * picture is used, and health is that of a filter that believes what it is told. */
#include "supervise/supervise.h"

#include <string.h>

#include "supervise/exclusion.h"
#include "supervise/health.h"
#include "supervise/readings.h"

#if !PLR_SUPERVISE

void plr_supervise_begin(plr_supervisor *s, const plr_config *config) {
    (void)config;
    memset(s, 0, sizeof *s);
    s->weight = 1;
    plr_sensors_forget(s);
    plr_supervise_clock_set(s);
}

static const plr_picture_decision all_is_well = {.use = true, .weight = 1};

plr_picture_decision plr_supervise_picture(plr_supervisor *s, const plr_picture_evidence *e) {
    (void)s;
    (void)e;
    return all_is_well;
}

plr_search_decision plr_supervise_search(plr_supervisor *s, const plr_search_evidence *e) {
    const plr_search_decision decision = {false, false, false, false};
    (void)s;
    (void)e;
    return decision;
}

void plr_supervise_frame(plr_supervisor *s, const plr_frame_evidence *e, const plr_report *report,
                         plr_frame_decision *decision) {
    memset(decision, 0, sizeof *decision);
    s->last_frame_ns = e->readings.now_ns;
    if (report->used > 0)
        s->last_use_ns = e->readings.now_ns;
}

void plr_supervise_pose_set(plr_supervisor *s) {
    (void)s;
}

plr_picture_decision plr_supervise_begun_anew(plr_supervisor *s, bool relocated) {
    s->relocated = relocated;
    return all_is_well;
}

void plr_supervise_moved(plr_supervisor *s, const plr_picture_evidence *e) {
    (void)s;
    (void)e;
}

void plr_supervise_reading(plr_supervisor *s, const plr_reading *reading, unsigned numbers,
                           bool used, plr_real d2, bool bounds, plr_time_ns now_ns) {
    (void)numbers, (void)used, (void)d2, (void)bounds, (void)now_ns;
    plr_sensors_note(s, reading);
}

plr_real plr_supervise_widening(const plr_supervisor *s, unsigned sensor) {
    (void)s;
    (void)sensor;
    return 1;
}

void plr_supervise_restored(plr_supervisor *s) {
    plr_sensors_forget(s);
}

void plr_supervise_enlarge(const plr_supervisor *s, const plr_real E[9], const plr_real p[3],
                           plr_real P_xi[PLR_POSE_SQUARE]) {
    (void)s, (void)E, (void)p, (void)P_xi;
}

void plr_supervise_tell(const plr_supervisor *s, const plr_frame_evidence *e,
                        plr_supervision *told) {
    memset(told, 0, sizeof *told);
    told->t_ns = s->last_frame_ns;
    told->matched = (uint16_t)e->picture.matched;
    told->same = (uint16_t)e->picture.same;
}

void plr_supervise_health(const plr_supervisor *s, const plr_readings_evidence *now,
                          plr_health_state *health) {
    plr_health_ages(s, now, health);
    health->health = now->started ? PLR_HEALTH_GOOD : PLR_HEALTH_LOST;
    health->reasons = now->started ? 0 : PLR_REASON_NOT_STARTED;
}

void plr_supervise_waits(plr_supervisor *s, const plr_readings_evidence *now, plr_report *report) {
    s->last_frame_ns = now->now_ns;
    report->health = PLR_HEALTH_LOST;
    report->reasons = PLR_REASON_NOT_STARTED;
}

void plr_supervise_refused(const plr_supervisor *s, plr_report *report) {
    (void)s;
    (void)report;
}

void plr_supervise_dead_reckons(plr_supervisor *s, const plr_readings_evidence *now) {
    (void)s;
    (void)now;
}

plr_misfit plr_exclusion_misfit(uint64_t left_out, const plr_exclusion_evidence *all,
                                plr_real nu2) {
    (void)left_out, (void)all, (void)nu2;
    return PLR_MISFIT_NONE;
}

bool plr_exclusion_has_support(uint64_t left_out, const plr_exclusion_evidence *all,
                               plr_misfit misfit) {
    (void)left_out, (void)all, (void)misfit;
    return false;
}

bool plr_exclusion_is_well_spread(uint64_t left_out, plr_real unobserved) {
    (void)left_out, (void)unobserved;
    return false;
}

#endif
