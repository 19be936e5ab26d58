// SPDX-License-Identifier: MIT
#include <math.h>
#include <string.h>

#include "posix/json.h"
#include "posix/settings_text.h"
#include "posix/summary.h"

static void put_build(json_object *o, const plr_session *session, const char *path) {
    char fingerprint[16];
    snprintf(fingerprint, sizeof fingerprint, "%08x", (unsigned)plr_build_fingerprint());
    json_string(o, "recording", path);
    json_string(o, "name", session->header.name);
    json_string(o, "version", plr_version());
    json_string(o, "build", fingerprint);
    json_string(o, "precision", sizeof(plr_real) == sizeof(float) ? "float32" : "float64");
}

static void put_settings(json_object *o, const plr_config *config) {
    for (unsigned i = 0; i < plr_setting_count(); i++) {
        const plr_setting *setting = plr_setting_at(i);
        const double value = plr_config_get(config, setting);
        char key[64], word[64];
        snprintf(key, sizeof key, "%s", setting->name);
        for (char *dash = key; (dash = strchr(dash, '-')) != NULL;)
            *dash = '_';
        setting_value_to_text(setting, value, word, sizeof word);
        if (setting->choices != NULL)
            json_string(o, key, word);
        else
            json_number(o, key, value);
    }
}

static void put_figures(json_object *o, const summary *s, const summary_figures *figures) {
    json_number(o, "path_m", s->path_m);
    json_number(o, "duration_s", figures->duration_s);
    json_number(o, "update_us_median", figures->update_us_median);
    json_number(o, "update_us_p99", figures->update_us_p99);
    json_number(o, "update_us_max", figures->update_us_max);
    json_number(o, "compute_s", (double)s->compute_ns * 1e-9);
    json_number(o, "wall_s", s->wall_s);
    json_number(o, "realtime_factor", figures->realtime_factor);
}

static void put_counts(json_object *o, const summary *s, const plr_session *session) {
    json_count(o, "frames", s->frames);
    json_count(o, "frames_refused", s->frames_refused);
    json_count(o, "twists", session->totals.twists);
    json_count(o, "observations", s->observations);
    json_count(o, "matched", s->matched);
    json_count(o, "used", s->used);
    json_count(o, "gated", s->gated);
    json_count(o, "new", s->created);
    json_count(o, "evicted", s->evicted);
    json_count(o, "no_room", s->no_room);
    json_count(o, "poor", s->poor);
    json_count(o, "left_out", s->left_out);
    json_count(o, "refused_observations", s->refused_observations);
    json_count(o, "duplicates", s->duplicates);
    json_count(o, "blocks_failed", s->blocks_failed);
    json_count(o, "frames_good", summary_frames_in(s, PLR_HEALTH_GOOD));
    json_count(o, "frames_degraded", summary_frames_in(s, PLR_HEALTH_DEGRADED));
    json_count(o, "frames_lost", summary_frames_in(s, PLR_HEALTH_LOST));
    json_count(o, "frames_diverged", summary_frames_in(s, PLR_HEALTH_DIVERGED));
    json_count(o, "frames_before_start", s->before_start);
    json_count(o, "recoveries", s->recoveries);
    json_number(o, "diverged_s", s->diverged_ns > 0 ? (double)s->diverged_ns * 1e-9 : nan(""));
}

static void put_readings(json_object *o, const plr_session *session) {
    plr_totals totals;
    if (session->totals.readings == 0 || plr_filter_totals(&session->filter, &totals) != PLR_OK)
        return;
    json_count(o, "readings", session->totals.readings);
    json_count(o, "readings_used", totals.readings - totals.readings_gated);
    json_count(o, "readings_gated", totals.readings_gated);
    json_count(o, "readings_refused", totals.readings_refused);
}

static void put_steps(json_object *o, const plr_session *session) {
    if (session->totals.imus > 0) {
        json_count(o, "imu_readings", session->totals.imu_readings);
        json_count(o, "imu_refused", session->totals.imu_refused);
    }
    if (session->totals.other_process > 0)
        json_count(o, "other_process", session->totals.other_process);
}

static void put_damage(json_object *o, const summary *s, const plr_session *session) {
    const plr_reader_counts *c = &session->reader.counts;
    json_count(o, "bytes", c->bytes);
    json_count(o, "damaged", c->damaged);
    json_count(o, "unknown", c->unknown);
    json_count(o, "malformed", c->malformed);
    json_count(o, "too_long", c->too_long);
    json_count(o, "missing", c->missing);
    json_count(o, "messages_refused", session->totals.refused);
    json_count(o, "without_truth", session->totals.without_truth);
    json_count(o, "reanchored", session->totals.reanchored);
    json_count(o, "late", session->totals.late);
    json_count(o, "held_short", session->totals.held_short);
    json_count(o, "over_deadline", session->totals.over_deadline);
    json_count(o, "warnings", s->warnings);
    json_flag(o, "cut_in_frame", s->cut_in_frame);
    json_flag(o, "ended", s->ended);
}

void summary_print_json(summary *s, const plr_session *session, const char *path) {
    summary_figures figures;
    json_object o;
    summary_figures_of(s, &figures);
    json_begin(&o, stdout);
    put_build(&o, session, path);
    put_figures(&o, s, &figures);
    put_counts(&o, s, session);
    put_readings(&o, session);
    put_steps(&o, session);
    put_damage(&o, s, session);
    put_settings(&o, plr_filter_config(&session->filter));
    json_end(&o);
}
