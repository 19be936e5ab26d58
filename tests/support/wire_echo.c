// SPDX-License-Identifier: MIT
/*
 * Reads a .plr stream on stdin, writes every message of it on stdout with a writer of its own, and
 * on stderr one line of counts: "bytes=N frames=N damaged=N ...". An undamaged stream whose END is
 * right comes back byte by byte. For the tests of C against Python.
 *
 * Exit status: 0 the stream was read to its end; 1 stdin or stdout failed; 3 it is of a later major
 * version.
 */
#include <inttypes.h>
#include <stdio.h>

#include "pelorus/wire.h"

enum { CHUNK = 4096, FAILED = 1, FUTURE = 3 };

static int write_to_file(void *file, const uint8_t *bytes, size_t n) {
    return fwrite(bytes, 1, n, file) == n ? 0 : -1;
}

/* Echoes a chunk; the exit status so far. */
static int echo(plr_reader *r, plr_writer *w, const uint8_t *bytes, size_t n) {
    for (size_t at = 0, taken; at < n; at += taken) {
        plr_message message;
        plr_read_event event = plr_reader_feed(r, bytes + at, n - at, &taken, &message);
        if (event == PLR_READ_FUTURE)
            return FUTURE;
        if (event == PLR_READ_MESSAGE && plr_writer_put(w, &message) != PLR_OK)
            return FAILED;
    }
    return 0;
}

static void print_counts(const plr_reader *r) {
    const plr_reader_counts *c = &r->counts;
    fprintf(stderr,
            "bytes=%" PRIu64 " frames=%" PRIu32 " damaged=%" PRIu32 " unknown=%" PRIu32
            " malformed=%" PRIu32 " too_long=%" PRIu32 " missing=%" PRIu32 " mid_frame=%d\n",
            c->bytes, c->frames, c->damaged, c->unknown, c->malformed, c->too_long, c->missing,
            plr_reader_mid_frame(r));
}

int main(void) {
    static uint8_t buffer[PLR_WIRE_STEREO_BODY(PLR_WIRE_MAX_OBSERVATIONS)], chunk[CHUNK];
    static plr_observation observations[PLR_WIRE_MAX_OBSERVATIONS];
    plr_reader reader;
    plr_writer writer;
    plr_reader_init(&reader, buffer, sizeof buffer, observations, PLR_WIRE_MAX_OBSERVATIONS);
    plr_writer_init(&writer, write_to_file, stdout);
    int status = 0;
    for (size_t n; status == 0 && (n = fread(chunk, 1, sizeof chunk, stdin)) > 0;)
        status = echo(&reader, &writer, chunk, n);
    print_counts(&reader);
    if (status == 0 && (ferror(stdin) || fflush(stdout) != 0))
        status = FAILED;
    return status;
}
