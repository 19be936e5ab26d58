// SPDX-License-Identifier: MIT
#include "posix/summary.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "posix/gate.h"
#include "posix/program.h"
#include "posix/settings_text.h"

void summary_init(summary *s) {
    memset(s, 0, sizeof *s);
    samples_init(&s->compute_us, sizeof(double));
}

void summary_free(summary *s) {
    samples_free(&s->compute_us);
}

static void add_counts(summary *s, const plr_report *report) {
    s->observations += report->observations;
    s->matched += report->matched;
    s->used += report->used;
    s->gated += report->gated;
    s->created += report->created;
    s->evicted += report->evicted;
    s->refused_observations += report->refused;
    s->duplicates += report->duplicates;
    s->no_room += report->no_room;
    s->poor += report->poor;
    s->left_out += report->left_out;
    s->blocks_failed += report->blocks_failed;
    if (s->before_start == s->frames && report->reasons & PLR_REASON_NOT_STARTED)
        s->before_start++;
    s->health[report->health]++;
    if (report->reasons & PLR_REASON_RECOVERED) {
        if (s->recoveries == 0)
            s->diverged_ns = report->t_ns;
        s->recoveries++;
    }
}

static void add_pose(summary *s, const plr_pose_message *pose) {
    double squared = 0;
    if (s->frames == 0) {
        s->first_ns = pose->t_ns;
        s->last_pose = pose->T_WB;
    }
    for (int i = 0; i < 3; i++)
        squared += pow(pose->T_WB.p[i] - s->last_pose.p[i], 2);
    s->path_m += sqrt(squared);
    s->last_pose = pose->T_WB;
    s->last_ns = pose->t_ns;
}

void summary_add_frame(summary *s, const plr_frame_result *result) {
    const double us = (double)result->compute_ns / 1e3;
    if (result->pose == NULL) {
        s->frames_refused++;
        return;
    }
    add_pose(s, result->pose);
    add_counts(s, result->report);
    samples_add(&s->compute_us, &us);
    s->compute_ns += result->compute_ns;
    s->frames++;
}

uint64_t summary_frames_in(const summary *s, plr_health health) {
    const bool waited = health == PLR_HEALTH_LOST && s->before_start < s->frames;
    return s->health[health] - (waited ? s->before_start : 0);
}

void summary_figures_of(summary *s, summary_figures *figures) {
    samples_sort_doubles(&s->compute_us);
    figures->update_us_median = samples_quantile(&s->compute_us, 0.5);
    figures->update_us_p99 = samples_quantile(&s->compute_us, 0.99);
    figures->update_us_max = samples_quantile(&s->compute_us, 1);
    figures->duration_s = s->last_ns > s->first_ns ? (double)(s->last_ns - s->first_ns) * 1e-9 : 0;
    figures->realtime_factor =
        s->compute_ns > 0 ? figures->duration_s * 1e9 / (double)s->compute_ns : nan("");
}

static void print_filter(const plr_session *session) {
    static const char *const shown[] = {"model", "mode", "bias", "twist-timing"};
    const plr_config *config = plr_filter_config(&session->filter);
    printf("filter        float%u", (unsigned)(8 * sizeof(plr_real)));
    for (unsigned i = 0; i < sizeof shown / sizeof shown[0]; i++) {
        const plr_setting *setting = plr_setting_by_name(shown[i]);
        char value[64];
        setting_value_to_text(setting, plr_config_get(config, setting), value, sizeof value);
        printf(", %s %s", shown[i], value);
    }
    char capacity[64];
    program_capacity(config, capacity, sizeof capacity);
    printf(", %s\n", capacity);
}

static double percent(uint64_t part, uint64_t whole) {
    return whole > 0 ? 100 * (double)part / (double)whole : 0;
}

/* A sound filter loses to the gate what the gate is set to, and outliers. Much more than that is an
 * everyday fault of geometry, ids or clocks, or a noise setting that does not fit: a user who knows
 * of one of these alone looks there for long. */
static void print_gate_hint(const summary *s, const plr_session *session) {
    enum { ENOUGH = 100 };
    static const char clocks[] = "--twist-timing, --camera-offset";
    const plr_config *config = plr_filter_config(&session->filter);
    const bool imu = session->totals.imus > 0;
    static const double suspicious = 10, times_due = 5;
    const double share = percent(s->gated, s->matched);
    const double due = 100 * gate_excess(config->gate_d2);
    if (config->gate_d2 <= 0 || config->gate_residual_px > 0 || s->matched < ENOUGH ||
        share < suspicious || share < times_due * due)
        return;
    printf(
        "              hint: of sound observations this gate turns away %.2g %%. Is one of these "
        "off?\n"
        "              geometry: extrinsic, lever, axes and units of %s, baseline, focal length\n"
        "              ids: each must follow one point; left and right; a scene that moves\n"
        "              clocks: %s\n"
        "              noise: %s, --pixel-sigma, --bias and its walks\n"
        "              pelorus check tells which, as far as the recording does\n",
        due, imu ? "the IMU" : "the twists", imu ? "--camera-offset" : clocks,
        imu ? "--gyro-noise, --accel-noise" : "--velocity-sigma, --gyro-sigma");
}

/* Of small sensors, where there are any. */
static void print_readings(const plr_session *session) {
    plr_totals totals;
    if (session->totals.readings == 0 || plr_filter_totals(&session->filter, &totals) != PLR_OK)
        return;
    printf("readings      %" PRIu32 ": %" PRIu32 " used, %" PRIu32 " rejected by the gate, %" PRIu32
           " refused\n",
           session->totals.readings, totals.readings - totals.readings_gated, totals.readings_gated,
           totals.readings_refused);
}

/* What moved the body, and what came of the other kind. */
static void print_steps(const plr_session *session) {
    const plr_session_totals *totals = &session->totals;
    const bool by_imu = totals->imus > 0 || session->header.process == PLR_PROCESS_IMU;
    if (by_imu)
        printf("%" PRIu32 " IMU readings, %" PRIu32 " refused%s", totals->imu_readings,
               totals->imu_refused, totals->twists > 0 ? "; " : "");
    if (totals->twists > 0 || !by_imu)
        printf("%" PRIu32 " twists", totals->twists);
    if (totals->other_process > 0)
        printf("; %" PRIu32 " messages not used, see the setting process", totals->other_process);
    printf("\n");
}

static void print_counts(const summary *s, const plr_session *session) {
    printf("frames        %" PRIu64 " used, %" PRIu64 " refused; ", s->frames, s->frames_refused);
    print_steps(session);
    printf("observations  %" PRIu64 ": %" PRIu64 " used, %" PRIu64 " gated (%.1f %% of matched), "
           "%" PRIu64 " new, %" PRIu64 " evicted\n",
           s->observations, s->used, s->gated, percent(s->gated, s->matched), s->created,
           s->evicted);
    print_gate_hint(s, session);
    printf("not used      %" PRIu64 " without a slot, %" PRIu64 " too poor to start from, %" PRIu64
           " malformed, %" PRIu64 " doubled, %" PRIu64 " over budget\n",
           s->no_room, s->poor, s->refused_observations, s->duplicates, s->left_out);
    print_readings(session);
    printf("health        %" PRIu64 " frames good, %" PRIu64 " degraded, %" PRIu64 " lost, %" PRIu64
           " diverged",
           summary_frames_in(s, PLR_HEALTH_GOOD), summary_frames_in(s, PLR_HEALTH_DEGRADED),
           summary_frames_in(s, PLR_HEALTH_LOST), summary_frames_in(s, PLR_HEALTH_DIVERGED));
    if (s->before_start > 0 && s->before_start < s->frames)
        printf(", after %" PRIu64 " before the start", s->before_start);
    printf("\n");
    if (s->recoveries > 0)
        printf("              diverged and recovered %" PRIu64
               " times, first at %.3f s: the pose was kept,\n"
               "              the landmarks were dropped\n",
               s->recoveries, (double)s->diverged_ns * 1e-9);
}

/* What was estimated of the calibration: pelorus info has it in full. */
static void print_calibration(const plr_session *session) {
    static const struct {
        const char *name, *unit;
        double scale;
    } parts[PLR_CALIBRATION_ERRORS] = {{"baseline", "%", 100},
                                       {"focal length", "%", 100},
                                       {"turn x", "deg", 57.29578},
                                       {"turn y", "deg", 57.29578},
                                       {"turn z", "deg", 57.29578},
                                       {"cx", "px", 1},
                                       {"cy", "px", 1},
                                       {"place x", "mm", 1000},
                                       {"place y", "mm", 1000},
                                       {"place z", "mm", 1000},
                                       {"clock", "ms", 1000},
                                       {"wheel scale", "%", 100},
                                       {"wheel track", "%", 100}};
    plr_calibration_result told;
    const char *between = "calibration   corrected by ";
    if (plr_filter_calibration(&session->filter, &told) != PLR_OK || told.estimated == 0)
        return;
    for (unsigned k = 0; k < PLR_CALIBRATION_ERRORS; k++)
        if ((told.estimated >> k & 1) != 0) {
            printf("%s%s %+.3f (+- %.3f) %s", between, parts[k].name,
                   told.corrected[k] * parts[k].scale, told.sigma[k] * parts[k].scale,
                   parts[k].unit);
            between = ", ";
        }
    printf("\n");
}

static void print_damage(const summary *s, const plr_session *session) {
    const plr_reader_counts *c = &session->reader.counts;
    const uint32_t skipped = c->damaged + c->unknown + c->malformed + c->too_long;
    if (skipped == 0 && c->missing == 0 && session->totals.refused == 0 && !s->cut_in_frame &&
        s->ended)
        return;
    printf("damage        frames skipped: %" PRIu32 " damaged, %" PRIu32 " unknown, %" PRIu32
           " malformed, %" PRIu32 " too long; %" PRIu32 " missing; messages refused: %" PRIu32
           "%s\n",
           c->damaged, c->unknown, c->malformed, c->too_long, c->missing, session->totals.refused,
           s->ended ? "" : "; no END");
}

/* A recording is somebody else's: what a terminal would obey is shown, not sent to it. The controls
 * are the bytes below the blank, DEL, and in UTF-8 0xc2 0x80 to 0xc2 0x9f. */
static void print_shown(const char *words) {
    for (const unsigned char *c = (const unsigned char *)words; *c != '\0'; c++) {
        if (*c < ' ' || *c == 0x7f)
            printf("\\x%02x", *c);
        else if (*c == 0xc2 && c[1] >= 0x80 && c[1] < 0xa0)
            printf("\\x%02x", *++c);
        else
            putchar(*c);
    }
}

static void print_recording(const char *path, const char *name, double duration_s) {
    printf("recording     ");
    print_shown(path);
    if (name[0] != '\0') {
        printf(" (");
        print_shown(name);
        printf(")");
    }
    printf(", %.1f s\n", duration_s);
}

void summary_print(summary *s, const plr_session *session, const char *path, const char *log) {
    summary_figures figures;
    summary_figures_of(s, &figures);
    print_recording(path, session->header.name, figures.duration_s);
    print_filter(session);
    print_counts(s, session);
    printf("path          %.1f m\n", s->path_m);
    print_calibration(session);
    printf("time a frame  median %.0f us, p99 %.0f us, max %.0f us; %.0f times real time; the "
           "replay took %.2f s\n",
           figures.update_us_median, figures.update_us_p99, figures.update_us_max,
           figures.realtime_factor, s->wall_s);
    if (session->totals.truths > 0)
        printf("accuracy      %spelorus evaluate %s\n",
               log != NULL ? "" : "give --out LOG.plr, then ", log != NULL ? log : "LOG.plr");
    print_damage(s, session);
}
