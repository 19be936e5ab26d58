// SPDX-License-Identifier: MIT
#include "posix/map_in.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pelorus/config.h"
#include "posix/file_port.h"

/* What one reading needs; too large for a stack. */
typedef struct desk {
    file_port port;
    plr_reader reader;
    plr_message in;
    uint8_t body[PLR_WIRE_STEREO_BODY(PLR_MAX_OBSERVATIONS)];
    plr_observation observations[PLR_MAX_OBSERVATIONS];
    bool ended;
} desk;

static void take(map_in *map, desk *d) {
    if (d->in.kind == PLR_KIND_HEADER && map->header.version_major == 0)
        map->header = d->in.as.header;
    if (d->in.kind == PLR_KIND_LANDMARK) {
        plr_landmark landmark = d->in.as.landmark.landmark;
        landmark.known = d->in.as.landmark.role == PLR_LANDMARK_KNOWN;
        landmark.last_seen_ns = 0; /* docs/REPLAY-FORMAT.md: of a known one */
        samples_add(&map->landmarks, &landmark);
    }
    d->ended = d->ended || d->in.kind == PLR_KIND_END;
}

static void read_all(map_in *map, desk *d) {
    const plr_port port = file_port_functions(&d->port);
    uint8_t piece[256];
    (void)plr_reader_init(&d->reader, d->body, sizeof d->body, d->observations,
                          PLR_MAX_OBSERVATIONS);
    for (int n; (n = port.read(port.context, piece, sizeof piece)) > 0;)
        for (size_t at = 0, taken = 0; at < (size_t)n; at += taken)
            if (plr_reader_feed(&d->reader, piece + at, (size_t)n - at, &taken, &d->in) ==
                PLR_READ_MESSAGE)
                take(map, d);
}

/* ---------------------------------------------------------------- what must hold */

static bool say(char *problem, const char *path, const char *words) {
    snprintf(problem, PROBLEM_SIZE, "--map-in %.200s: %.280s", path, words);
    return false;
}

/* What is wrong with a landmark; NULL: nothing. */
static const char *fault(const plr_landmark *l) {
    const double *P = l->P_W_m2;
    double trace = 0;
    for (int i = 0; i < 3; i++)
        if (!isfinite(l->p_W_m[i]))
            return "its position is not finite";
    for (int i = 0; i < 9; i++)
        if (!isfinite(P[i]))
            return "its covariance is not finite";
    for (int i = 0; i < 9; i += 4) {
        if (P[i] < 0)
            return "its covariance has a negative variance";
        trace += P[i];
    }
    if (trace <= 0)
        return "it has no covariance (all zeros); a result of --out has one";
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < i; j++)
            if (P[3 * i + j] * P[3 * i + j] > P[4 * i] * P[4 * j] * (1 + 1e-9))
                return "its covariance is not positive: a correlation is beyond 1";
    const double determinant = P[0] * (P[4] * P[8] - P[5] * P[5]) -
                               P[1] * (P[1] * P[8] - P[5] * P[2]) +
                               P[2] * (P[1] * P[5] - P[4] * P[2]);
    if (determinant < -1e-9 * P[0] * P[4] * P[8])
        return "its covariance is not positive: its determinant is negative";
    return NULL;
}

/* Of a log that holds results, those are the map: what was known to the filter that made it stands
 * among its inputs, under the same ids. */
static void choose(samples *list) {
    plr_landmark *landmarks = list->items;
    bool results = false;
    size_t kept = 0;
    for (size_t i = 0; i < list->count; i++)
        results = results || !landmarks[i].known;
    for (size_t i = 0; i < list->count; i++)
        if (!results || !landmarks[i].known) {
            landmarks[kept] = landmarks[i];
            landmarks[kept++].known = true;
        }
    list->count = kept;
}

/* Points of which it is not known where they are (from 1000 km on): too far away to have a distance, or of
 * a filter that has diverged. They would locate nobody. What is not finite is not left out: it is wrong. */
static void leave_out_unknown(map_in *map) {
    plr_landmark *landmarks = map->landmarks.items;
    size_t kept = 0;
    for (size_t i = 0; i < map->landmarks.count; i++) {
        const double *P = landmarks[i].P_W_m2, trace = P[0] + P[4] + P[8];
        if (isfinite(trace) && trace >= PLR_WIRE_UNKNOWN_VARIANCE)
            map->left_out++;
        else
            landmarks[kept++] = landmarks[i];
    }
    map->landmarks.count = kept;
}

static int by_id(const void *a, const void *b) {
    const uint32_t x = ((const plr_landmark *)a)->id, y = ((const plr_landmark *)b)->id;
    return (x > y) - (x < y);
}

static bool check_landmarks(map_in *map, char *problem) {
    plr_landmark *landmarks = map->landmarks.items;
    char words[PROBLEM_SIZE];
    for (size_t i = 0; i < map->landmarks.count; i++) {
        const char *wrong = fault(&landmarks[i]);
        if (wrong != NULL) {
            snprintf(words, sizeof words, "landmark %" PRIu32 ": %s", landmarks[i].id, wrong);
            return say(problem, map->path, words);
        }
    }
    qsort(landmarks, map->landmarks.count, sizeof *landmarks, by_id);
    for (size_t i = 1; i < map->landmarks.count; i++)
        if (landmarks[i].id == landmarks[i - 1].id) {
            snprintf(words, sizeof words,
                     "landmark %" PRIu32 " stands twice, and which one is right cannot be told: "
                     "make the map with --slots for all that come back",
                     landmarks[i].id);
            return say(problem, map->path, words);
        }
    return true;
}

static bool check_file(const map_in *map, const desk *d, char *problem) {
    char words[128];
    if (file_port_problem(&d->port) != NULL)
        return say(problem, map->path, file_port_problem(&d->port));
    if (map->landmarks.out_of_memory)
        return say(problem, map->path, "out of memory");
    if (d->reader.counts.frames == 0)
        return say(problem, map->path, "is not a Pelorus file: give a result of --out");
    if (map->header.version_major == 0)
        return say(problem, map->path, "has no HEADER, so its axes are not known");
    if (map->landmarks.count == 0 && map->left_out > 0)
        return say(problem, map->path,
                   "holds no landmark whose place is known: has the filter that made it diverged?");
    if (map->landmarks.count == 0)
        return say(problem, map->path,
                   "holds no landmark: give a result of --out, of a drive in slam or mapping");
    if (map->landmarks.count > MAP_IN_MOST) {
        snprintf(words, sizeof words, "holds %zu landmarks; %d are the most", map->landmarks.count,
                 MAP_IN_MOST);
        return say(problem, map->path, words);
    }
    if (!d->ended)
        return say(problem, map->path, "was cut short: it has no END, so landmarks may be missing");
    return true;
}

bool map_in_read(map_in *map, const char *path, char problem[PROBLEM_SIZE]) {
    memset(map, 0, sizeof *map);
    samples_init(&map->landmarks, sizeof(plr_landmark));
    map->path = path;
    if (path == NULL)
        return true;
    desk *d = calloc(1, sizeof *d);
    if (d == NULL || !file_port_open(&d->port, path)) {
        const int error = d == NULL ? ENOMEM : errno;
        free(d);
        return say(problem, path, strerror(error));
    }
    read_all(map, d);
    choose(&map->landmarks);
    leave_out_unknown(map);
    const bool good = check_file(map, d, problem) && check_landmarks(map, problem);
    file_port_close(&d->port);
    free(d);
    return good;
}

void map_in_free(map_in *map) {
    samples_free(&map->landmarks);
}

/* ---------------------------------------------------------------- map and recording */

static const char *axes_text(uint8_t axes) {
    return axes == PLR_AXES_FLU   ? "forward, left, up"
           : axes == PLR_AXES_FRD ? "forward, right, down"
                                  : "others";
}

bool map_in_fits(const map_in *map, const plr_header *recording, char problem[PROBLEM_SIZE]) {
    char words[PROBLEM_SIZE];
    if (map->path == NULL || map->header.body_axes == recording->body_axes)
        return true;
    snprintf(words, sizeof words,
             "is in another frame: its body axes are %s, the recording's are %s",
             axes_text(map->header.body_axes), axes_text(recording->body_axes));
    return say(problem, map->path, words);
}

bool map_in_is_of_another_camera(const map_in *map, const plr_header *recording) {
    const plr_calibration *a = &map->header.calibration, *b = &recording->calibration;
    const double ours[5] = {a->fx_px, a->fy_px, a->cx_px, a->cy_px, a->baseline_m};
    const double theirs[5] = {b->fx_px, b->fy_px, b->cx_px, b->cy_px, b->baseline_m};
    return map->path != NULL && memcmp(ours, theirs, sizeof ours) != 0;
}
