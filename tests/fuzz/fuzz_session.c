// SPDX-License-Identifier: MIT
/*
 * Fuzz harness of the whole loop, for libFuzzer: bytes -> reader -> session -> filter -> answers.
 *
 *     cmake -S . -B build-fuzz -DPELORUS_FUZZ=ON -DCMAKE_C_COMPILER=clang-14
 *     cmake --build build-fuzz -j2
 *     build-fuzz/bin/fuzz_session -max_len=8192 found tests/fuzz/corpus_session
 *
 * test_fuzz_session.c runs the same harness under CTest without it.
 *
 * An input's first two bytes choose settings, options and storage; the rest is a stream as it came
 * off a wire, or records [kind u8][size u16][payload], of which the harness makes sound frames, for
 * no random bytes get past the checksum. Whatever comes in:
 * - the session ends, in no more steps than there are bytes;
 * - every answer can be read, and counts add up;
 * - every pose and landmark that leaves is made of numbers, a rotation is one, and no variance of a
 *   pose is negative (a known landmark's may be, by what rounding left of a rough start);
 * - the same bytes give the same answers, in whatever pieces they arrive.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pelorus/session.h"
#include "record/cobs.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Of the first byte; the two lowest bits are the mode, the next one the model. */
enum { MODE_BITS = 3, WORLD = 4, BIAS = 8, KNOWN_MAP = 16, STORAGE = 32, TIGHT = 64, STREAM = 128 };

/* Of the second byte; the three lowest bits are the start. */
enum { START_BITS = 7, DELAY = 8, DEADLINE = 16, OPEN_GATE = 32 };

enum { STREAM_SIZE = 1 << 18, KNOWN = 16, DEVICE_SIZE = 1 << 16, ERASE_SIZE = 4096 };

#define REQUIRE(holds) require((holds), #holds, __LINE__)

static void require(int holds, const char *what, int line) {
    if (holds)
        return;
    fprintf(stderr, "fuzz_session.c:%d: does not hold: %s\n", line, what);
    abort();
}

/* --- what leaves the session --- */

static void require_finite(const double *x, unsigned n) {
    for (unsigned i = 0; i < n; i++)
        REQUIRE(isfinite(x[i]));
}

/* A packed lower triangle. */
static void require_covariance(const double *packed, unsigned n) {
    require_finite(packed, n * (n + 1) / 2);
    for (unsigned i = 0; i < n; i++)
        REQUIRE(packed[i * (i + 3) / 2] >= 0);
}

static void require_rotation(const double R[9]) {
    require_finite(R, 9);
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j < 3; j++) {
            double product = i == j ? -1 : 0;
            for (unsigned k = 0; k < 3; k++)
                product += R[3 * i + k] * R[3 * j + k];
            REQUIRE(fabs(product) < 1e-3);
        }
}

static void check_pose(void *context, const plr_pose_message *pose) {
    (void)context;
    require_rotation(pose->T_WB.R);
    require_finite(pose->T_WB.p, 3);
    require_finite(pose->velocity.v_B_mps, 3);
    require_finite(pose->velocity.w_B_radps, 3);
    require_finite(pose->bias, 6);
    require_covariance(pose->P_xi, 6);
    require_covariance(pose->P_u, 6);
}

static void check_landmark(void *context, const plr_landmark_message *message) {
    (void)context;
    const double *P = message->landmark.P_W_m2;
    require_finite(message->landmark.p_W_m, 3);
    require_finite(P, 9);
}

static void check_frame(void *context, const plr_frame_result *result) {
    (void)context;
    const plr_report *r = result->report;
    REQUIRE(r->t_ns == result->frame->t_ns);
    REQUIRE(r->observations == result->frame->count);
    REQUIRE(r->matched <= r->observations);
    REQUIRE(r->used + r->gated + r->left_out <= r->matched);
    REQUIRE(r->refused + r->duplicates <= r->observations);
    REQUIRE(r->active <= PLR_MAX_LANDMARKS);
    REQUIRE(isfinite(r->nis) && r->nis >= 0);
    REQUIRE((result->pose != NULL) == (r->status == PLR_OK || r->status == PLR_E_DIVERGED));
    REQUIRE((r->health == PLR_HEALTH_DIVERGED) == (r->status == PLR_E_DIVERGED));
}

static void check_text(void *context, const plr_text *text) {
    (void)context;
    REQUIRE(memchr(text->text, '\0', sizeof text->text) != NULL);
    REQUIRE(text->severity <= PLR_SEVERITY_ERROR);
}

static void check_refused(void *context, plr_kind subject, plr_time_ns t_ns, plr_status status,
                          const plr_setting *culprit) {
    (void)context;
    (void)subject;
    (void)t_ns;
    REQUIRE(status < PLR_OK);
    REQUIRE(culprit == NULL || plr_setting_by_name(culprit->name) == culprit);
}

/* --- the machine around it --- */

typedef struct machine {
    const uint8_t *bytes; /* still to be read */
    size_t left, piece;
    plr_reader answers;
    uint8_t body[PLR_WIRE_STEREO_BODY(PLR_MAX_OBSERVATIONS) + PLR_WIRE_MIN_BUFFER];
    plr_observation observations[PLR_MAX_OBSERVATIONS];
    uint32_t crc; /* of all answers */
    uint64_t now_ns;
    uint8_t device[DEVICE_SIZE];
} machine;

static int read_bytes(void *context, uint8_t *bytes, size_t n) {
    machine *m = context;
    if (m->left == 0)
        return PLR_PORT_CLOSED;
    if (n > m->piece)
        n = m->piece;
    if (n > m->left)
        n = m->left;
    memcpy(bytes, m->bytes, n);
    m->bytes += n;
    m->left -= n;
    return (int)n;
}

static int write_bytes(void *context, const uint8_t *bytes, size_t n) {
    machine *m = context;
    m->crc = plr_crc32(m->crc, bytes, n);
    while (n > 0) {
        plr_message message;
        size_t taken;
        const plr_read_event event = plr_reader_feed(&m->answers, bytes, n, &taken, &message);
        REQUIRE(event != PLR_READ_SKIPPED && taken > 0);
        bytes += taken;
        n -= taken;
    }
    return 0;
}

static uint64_t now_ns(void *context) {
    machine *m = context;
    return m->now_ns += 1000;
}

static int device_read(void *context, uint32_t offset, uint8_t *bytes, uint32_t n) {
    memcpy(bytes, ((machine *)context)->device + offset, n);
    return 0;
}

static int device_program(void *context, uint32_t offset, const uint8_t *bytes, uint32_t n) {
    memcpy(((machine *)context)->device + offset, bytes, n);
    return 0;
}

static int device_erase(void *context, uint32_t offset, uint32_t n) {
    memset(((machine *)context)->device + offset, 0xFF, n);
    return 0;
}

/* --- an input as a stream --- */

typedef struct byte_stream {
    uint8_t bytes[STREAM_SIZE];
    size_t length;
} byte_stream;

static void append(byte_stream *s, const uint8_t *bytes, size_t n) {
    REQUIRE(n <= sizeof s->bytes - s->length);
    memcpy(s->bytes + s->length, bytes, n);
    s->length += n;
}

static void stuff(byte_stream *s, plr_cobs_encoder *e, const uint8_t *bytes, size_t n) {
    for (size_t i = 0; i < n; i++) {
        const unsigned ready = plr_cobs_encode(e, bytes[i]);
        append(s, e->block, ready);
    }
}

static void append_frame(byte_stream *s, uint8_t kind, uint16_t sequence, const uint8_t *payload,
                         size_t n) {
    const uint8_t head[3] = {kind, (uint8_t)(sequence & 0xFF), (uint8_t)(sequence >> 8)};
    const uint32_t crc = plr_crc32(plr_crc32(0, head, sizeof head), payload, n);
    const uint8_t tail[4] = {(uint8_t)(crc & 0xFF), (uint8_t)(crc >> 8 & 0xFF),
                             (uint8_t)(crc >> 16 & 0xFF), (uint8_t)(crc >> 24)};
    plr_cobs_encoder e;
    plr_cobs_begin(&e);
    stuff(s, &e, head, sizeof head);
    stuff(s, &e, payload, n);
    stuff(s, &e, tail, sizeof tail);
    const unsigned ready = plr_cobs_end(&e);
    append(s, e.block, ready);
}

static void append_records(byte_stream *s, const uint8_t *data, size_t size) {
    for (uint16_t sequence = 0; size >= 3; sequence++) {
        size_t n = (size_t)(data[1] | data[2] << 8);
        if (n > size - 3)
            n = size - 3;
        append_frame(s, data[0], sequence, data + 3, n);
        data += 3 + n;
        size -= 3 + n;
    }
}

/* --- one run --- */

typedef struct choices {
    plr_wire_setting settings[7];
    unsigned count;
    plr_landmark known[KNOWN];
    plr_state_store store;
} choices;

static void choose(choices *c, const char *name, double value) {
    c->settings[c->count++] = (plr_wire_setting){plr_setting_by_name(name)->id, value};
}

static void choose_settings(choices *c, uint8_t first, uint8_t second) {
    c->count = 0;
    if (first & MODE_BITS)
        choose(c, "mode", first & MODE_BITS);
    if (first & WORLD)
        choose(c, "model", PLR_MODEL_WORLD);
    if (first & BIAS)
        choose(c, "bias", 1);
    if (first & KNOWN_MAP)
        choose(c, "known-map", 1);
    if (first & TIGHT)
        choose(c, "slots", 5); /* room for a few: they are evicted and asked for again */
    if (second & DELAY)
        choose(c, "twist-delay", 0.25);
    if (second & OPEN_GATE)
        choose(c, "gate-d2", 0);
}

static plr_session_options options_of(choices *c, machine *m, uint8_t first, uint8_t second) {
    plr_session_options options;
    plr_session_options_default(&options);
    choose_settings(c, first, second);
    options.overrides = c->settings;
    options.override_count = c->count;
    options.start = (plr_start_choice)((second & START_BITS) % (PLR_START_RECORDED + 1));
    options.output |= PLR_OUTPUT_TWIST_POSE | PLR_OUTPUT_ECHO;
    options.deadline_us = second & DEADLINE ? 5 : 0;
    options.known = c->known;
    options.known_capacity = KNOWN;
    options.observer.pose = check_pose;
    options.observer.landmark = check_landmark;
    options.observer.frame = check_frame;
    options.observer.text = check_text;
    options.observer.refused = check_refused;
    if (first & STORAGE) {
        const plr_block_device device = {m,           DEVICE_SIZE,    ERASE_SIZE,  16,
                                         device_read, device_program, device_erase};
        REQUIRE(plr_state_store_init(&c->store, &device) == PLR_OK);
        options.store = &c->store;
    }
    return options;
}

/* CRC-32 of all answers to the stream, read in pieces. */
static uint32_t answers_to(const byte_stream *in, size_t piece, uint8_t first, uint8_t second) {
    static plr_session session;
    static machine m;
    static choices c;
    const plr_port port = {
        .context = &m, .read = read_bytes, .write = write_bytes, .now_ns = now_ns};
    memset(&m, 0, sizeof m);
    m.bytes = in->bytes;
    m.left = in->length;
    m.piece = piece;
    REQUIRE(plr_reader_init(&m.answers, m.body, sizeof m.body, m.observations,
                            PLR_MAX_OBSERVATIONS) == PLR_OK);
    const plr_session_options options = options_of(&c, &m, first, second);
    if (plr_session_init(&session, &port, &options) != PLR_OK)
        return 0; /* settings that contradict each other */
    for (size_t steps = 0; plr_session_step(&session) != PLR_STEP_CLOSED; steps++)
        REQUIRE(steps <= in->length);
    plr_session_finish(&session);
    REQUIRE(session.totals.not_sent == 0);
    return m.crc;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static byte_stream in;
    if (size < 2)
        return 0;
    in.length = 0;
    if (data[0] & STREAM)
        append(&in, data + 2, size - 2);
    else
        append_records(&in, data + 2, size - 2);
    const uint32_t whole = answers_to(&in, 256, data[0], data[1]);
    const uint32_t in_pieces = answers_to(&in, 1 + size % 7, data[0], data[1]);
    REQUIRE(whole == in_pieces);
    return 0;
}
