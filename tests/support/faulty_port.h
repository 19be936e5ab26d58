// SPDX-License-Identifier: MIT
/*
 * A port over memory, with the faults of a real one: short reads, lost, doubled and damaged bytes,
 * writes that fail, a clock that stalls or jumps. The test is the far end of the link: it sends
 * messages and reads the answers. Every fault is drawn from a seed.
 */
#ifndef PELORUS_TEST_FAULTY_PORT_H
#define PELORUS_TEST_FAULTY_PORT_H

#include "pelorus/port.h"
#include "pelorus/wire.h"
#include "support/random.h"

enum { FAULTY_PORT_BYTES = 1 << 20 };

typedef struct faulty_port {
    /* Faults; all off after faulty_port_init. Shares are of bytes, or of calls. */
    unsigned most_at_once; /* bytes that one read gives; 0: no limit */
    double nothing_share;  /* reads that give nothing now */
    double lost_share, doubled_share, damaged_share;
    double refused_share;   /* writes that fail, having taken some of the bytes */
    uint64_t clock_step_ns; /* what the clock gains from call to call; 0: it stalls */
    unsigned clock_jump_at; /* number of the call at which it jumps; 0: never */
    uint64_t clock_jump_ns; /* added modulo 2^64, so it may go back */
    bool fails;             /* reads report a failure once all bytes are read */
    bool stays_open;        /* reads give nothing, instead of "closed", once all are read */

    /* What happened. */
    unsigned idles, feeds, clock_calls;

    rng random;
    uint64_t now_ns;
    plr_writer sender;
    uint8_t sent[FAULTY_PORT_BYTES];
    size_t sent_count, sent_at;
    bool pending; /* a doubled byte comes again */
    uint8_t answers[FAULTY_PORT_BYTES];
    size_t answer_count, answer_at;
    plr_reader receiver;
    uint8_t body[PLR_WIRE_STEREO_BODY(PLR_WIRE_MAX_OBSERVATIONS)];
    plr_observation observations[PLR_WIRE_MAX_OBSERVATIONS];
} faulty_port;

/* An open, faultless port with a clock that gains 1 us with each call. */
void faulty_port_init(faulty_port *port, uint64_t seed);

/* The functions to hand to a session. */
plr_port faulty_port_functions(faulty_port *port);

/* --- the far end --- */

/* Sends a message, or bytes as they are. */
void faulty_port_send(faulty_port *port, const plr_message *message);
void faulty_port_send_bytes(faulty_port *port, const uint8_t *bytes, size_t n);

/* The next whole answer; false if there is none. Frames that a failing write tore are passed over:
 * port->receiver.counts tells. */
bool faulty_port_answer(faulty_port *port, plr_message *answer);

/* The next answer of a kind; those before it are passed over. */
bool faulty_port_answer_of(faulty_port *port, plr_kind kind, plr_message *answer);

/* Reads the answers from the first one again. */
void faulty_port_answers_again(faulty_port *port);

#endif
