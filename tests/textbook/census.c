// SPDX-License-Identifier: MIT
#include "textbook/census.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "posix/file_port.h"
#include "session/layers.h"
#include "textbook/textbook.h"

/* What one reading needs; too large for a stack. */
static struct {
    file_port port;
    plr_reader reader;
    plr_message in;
    uint8_t body[PLR_SESSION_BODY];
    plr_observation observations[PLR_MAX_OBSERVATIONS];
} desk;

static void take(census *c, const plr_message *in) {
    if (in->kind == PLR_KIND_HEADER && c->header.version_major == 0)
        c->header = in->as.header;
    if (in->kind == PLR_KIND_LANDMARK && in->as.landmark.role == PLR_LANDMARK_KNOWN)
        c->known++;
    if (in->kind == PLR_KIND_CONFIG)
        for (unsigned i = 0; i < in->as.config.count; i++)
            (void)plr_layers_want(&c->wanted, in->as.config.settings[i]);
    if (in->kind != PLR_KIND_STEREO)
        return;
    for (unsigned i = 0; i < in->as.stereo.count; i++)
        samples_add(&c->seen, &in->as.stereo.observations[i]);
    if (in->as.stereo.count > c->most_seen)
        c->most_seen = in->as.stereo.count;
}

/* One piece of the file. */
static void take_bytes(census *c, const uint8_t *bytes, size_t n) {
    for (size_t at = 0; at < n;) {
        size_t taken = 0;
        if (plr_reader_feed(&desk.reader, bytes + at, n - at, &taken, &desk.in) == PLR_READ_MESSAGE)
            take(c, &desk.in);
        at += taken > 0 ? taken : n - at;
    }
}

bool census_read(census *c, const char *path) {
    memset(c, 0, sizeof *c);
    samples_init(&c->seen, sizeof(plr_observation));
    if (!file_port_open(&desk.port, path))
        return false;
    const plr_port port = file_port_functions(&desk.port);
    (void)plr_reader_init(&desk.reader, desk.body, sizeof desk.body, desk.observations,
                          PLR_MAX_OBSERVATIONS);
    uint8_t piece[256];
    for (int n; (n = port.read(port.context, piece, sizeof piece)) > 0;)
        take_bytes(c, piece, (size_t)n);
    const int error = desk.port.read_error;
    file_port_close(&desk.port);
    errno = c->seen.out_of_memory ? ENOMEM : error;
    return errno == 0;
}

void census_free(census *c) {
    samples_free(&c->seen);
}

static int by_id(const void *a, const void *b) {
    const uint32_t x = ((const plr_observation *)a)->id, y = ((const plr_observation *)b)->id;
    return (x > y) - (x < y);
}

unsigned census_landmarks(const census *c, const plr_config *config) {
    const plr_observation *seen = c->seen.items;
    const bool makes = config->mode == PLR_MODE_SLAM || config->mode == PLR_MODE_MAPPING;
    const bool asks = config->mode == PLR_MODE_LOCALIZATION || config->known_map != 0;
    unsigned count = asks ? c->known : 0;
    bool counted = false;
    if (!makes)
        return count;
    qsort(c->seen.items, c->seen.count, sizeof *seen, by_id);
    for (size_t i = 0; i < c->seen.count; i++) {
        if (i > 0 && seen[i].id != seen[i - 1].id)
            counted = false;
        if (!counted && textbook_is_worth_a_landmark(config, &c->header.calibration, &seen[i])) {
            counted = true;
            count++;
        }
    }
    return count;
}
