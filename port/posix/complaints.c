// SPDX-License-Identifier: MIT
#include "posix/complaints.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

enum { TOLD = 3 }; /* of each sort */

static const char *const kind_names[COMPLAINT_KINDS] = {
    [PLR_KIND_NONE] = "frame",
    [PLR_KIND_HEADER] = "HEADER",
    [PLR_KIND_CONFIG] = "CONFIG",
    [PLR_KIND_START] = "START",
    [PLR_KIND_TWIST] = "TWIST",
    [PLR_KIND_STEREO] = "STEREO",
    [PLR_KIND_TRUTH] = "TRUTH",
    [PLR_KIND_LANDMARK] = "LANDMARK",
    [PLR_KIND_POSE] = "POSE",
    [PLR_KIND_REPORT] = "REPORT",
    [PLR_KIND_TEXT] = "TEXT",
    [PLR_KIND_END] = "END",
    [PLR_KIND_STATE] = "STATE",
    [PLR_KIND_READING] = "READING",
    [PLR_KIND_IMU] = "IMU",
    [PLR_KIND_EVIDENCE] = "EVIDENCE",
    [PLR_KIND_CALIBRATION] = "CALIBRATION",
    [PLR_KIND_IMAGE] = "IMAGE",
    [PLR_KIND_RIG] = "RIG",
};

static const char *const skip_words[COMPLAINT_SKIPS] = {
    [PLR_SKIP_NONE] = "",
    [PLR_SKIP_DAMAGED] = "damaged frame (its CRC, stuffing or length is wrong)",
    [PLR_SKIP_UNKNOWN] = "frame of a kind that this version does not know",
    [PLR_SKIP_MALFORMED] = "frame whose content contradicts the format",
    [PLR_SKIP_TOO_LONG] = "frame longer than this build holds (see --version)",
};

void complaints_init(complaints *c, const char *path, bool quiet) {
    memset(c, 0, sizeof *c);
    c->path = path;
    c->quiet = quiet;
}

static void say(const complaints *c, const char *format, ...) {
    va_list arguments;
    if (c->quiet)
        return;
    va_start(arguments, format);
    fprintf(stderr, "%s: ", c->path);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
}

void complaints_say(const complaints *c, const char *words) {
    say(c, "%s", words);
}

/* Why, in the words of the recording; the filter's own words elsewhere. */
static const char *cause(plr_kind kind, plr_status status) {
    if (kind == PLR_KIND_STATE)
        return "a state that was kept elsewhere is not here, so what follows may differ from what "
               "was computed there; --load-state and --save-state give this replay a storage";
    if (status == PLR_E_NOT_READY)
        return "nothing can be done with it yet: there was no usable HEADER, or not the START or "
               "TRUTH that --start asks for";
    if (status == PLR_E_MODE && kind == PLR_KIND_HEADER)
        return "it differs from the HEADER in force; a calibration cannot change in mid-flight";
    if (status == PLR_E_MODE && kind == PLR_KIND_CONFIG)
        return "it differs from the settings in force; they cannot change in mid-flight";
    if (status == PLR_E_MODE && (kind == PLR_KIND_TWIST || kind == PLR_KIND_IMU))
        return "another one moves the body; this and all that follow of the kind are not used";
    if (kind == PLR_KIND_IMU && status == PLR_E_RANGE)
        return "at the setting gyro-range or accel-range, a spike, or a step beyond all reason";
    if (kind == PLR_KIND_IMU && status == PLR_E_ARGUMENT)
        return "the same numbers again and again";
    if (status == PLR_E_MODE && kind == PLR_KIND_STEREO)
        return "in mapping a frame needs a TRUTH of equal time";
    if (status == PLR_E_CONFIG && kind == PLR_KIND_CONFIG)
        return "a setting is unknown or outside its limits";
    if (kind == PLR_KIND_LANDMARK && status == PLR_E_FULL)
        return "there is no room for more known landmarks";
    if (kind == PLR_KIND_LANDMARK && status == PLR_E_EXISTS)
        return "a landmark of this id was given before";
    if (kind == PLR_KIND_START && status == PLR_E_TIME)
        return "it lies behind the first frame";
    return plr_status_text(status);
}

/* "TWIST 17 at 1.700000 s", "HEADER". */
static void place(char *text, size_t size, plr_kind kind, uint32_t number, plr_time_ns t_ns) {
    const char *name = kind_names[kind];
    if (number > 0)
        snprintf(text, size, "%s %" PRIu32 " at %" PRIu64 ".%06" PRIu64 " s", name, number,
                 t_ns / 1000000000u, t_ns / 1000u % 1000000u);
    else
        snprintf(text, size, "%s", name);
}

void complaints_refused(complaints *c, plr_kind kind, uint32_t number, plr_time_ns t_ns,
                        plr_status status, const plr_setting *culprit) {
    char where[96];
    const unsigned sort = (unsigned)-(int)status % COMPLAINT_STATUSES;
    if (c->refused[kind][sort]++ >= TOLD)
        return;
    place(where, sizeof where, kind, number, t_ns);
    if (culprit != NULL)
        say(c, "%s: refused: setting %s: %s", where, culprit->name, cause(kind, status));
    else
        say(c, "%s: refused: %s", where, cause(kind, status));
}

void complaints_observations(complaints *c, uint32_t number, const plr_report *report) {
    char where[96];
    if (report->refused == 0 && report->duplicates == 0)
        return;
    if (c->spoiled_frames++ >= TOLD)
        return;
    place(where, sizeof where, PLR_KIND_STEREO, number, report->t_ns);
    say(c,
        "%s: of %u observations %u left out (not finite, or beyond any image), %u with an id "
        "that stands twice",
        where, (unsigned)report->observations, (unsigned)report->refused,
        (unsigned)report->duplicates);
}

void complaints_skipped(complaints *c, const plr_reader *reader) {
    const plr_skip why = reader->skipped_why;
    if (c->skipped[why]++ >= TOLD)
        return;
    say(c, "byte %" PRIu64 ": %s skipped", reader->skipped_at, skip_words[why]);
}

static void more(const complaints *c, uint64_t count, const char *of, const char *what) {
    if (count > TOLD)
        say(c, "and %" PRIu64 " more: %s%s", count - TOLD, of, what);
}

void complaints_end(const complaints *c) {
    for (unsigned kind = 0; kind < COMPLAINT_KINDS; kind++)
        for (unsigned sort = 0; sort < COMPLAINT_STATUSES; sort++) {
            char of[32];
            snprintf(of, sizeof of, "%s refused: ", kind_names[kind]);
            more(c, c->refused[kind][sort], of, cause((plr_kind)kind, (plr_status)(-(int)sort)));
        }
    for (unsigned why = 0; why < COMPLAINT_SKIPS; why++)
        more(c, c->skipped[why], skip_words[why], " skipped");
    more(c, c->spoiled_frames, "STEREO", " with observations left out");
}
