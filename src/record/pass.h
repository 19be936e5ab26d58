// SPDX-License-Identifier: MIT
/*
 * A pass visits the fields of a message in the order of its frame. READ fills the fields from a
 * payload, WRITE sends them, CHECK only finds out whether the message can be written. So one
 * function a message (layout.h) serves all three.
 *
 * The first fault is kept: what is read after it is zero, and the message must not be used.
 */
#ifndef PLR_RECORD_PASS_H
#define PLR_RECORD_PASS_H

#include "pelorus/wire.h"

typedef enum plr_direction { PLR_PASS_CHECK, PLR_PASS_READ, PLR_PASS_WRITE } plr_direction;

typedef enum plr_fault {
    PLR_FAULT_NONE,
    PLR_FAULT_MALFORMED, /* too short, or a value that the format does not know */
    PLR_FAULT_TOO_LONG,  /* more observations than the reader has room for */
    PLR_FAULT_UNKNOWN,   /* a kind that the format does not know */
    PLR_FAULT_FUTURE     /* a HEADER of a higher major version */
} plr_fault;

typedef struct plr_pass {
    plr_direction direction;
    plr_fault fault;               /* the first one */
    const uint8_t *payload;        /* READ: what is left of it */
    size_t left;                   /* READ: its length */
    plr_observation *observations; /* READ: room for those of a frame */
    unsigned max_observations;     /* READ */
    plr_writer *writer;            /* WRITE */
} plr_pass;

static inline bool plr_pass_reads(const plr_pass *p) {
    return p->direction == PLR_PASS_READ;
}

/* Records a fault, unless there was one before. */
void plr_pass_fail(plr_pass *p, plr_fault fault);

/* Records PLR_FAULT_MALFORMED unless `holds`. */
void plr_pass_require(plr_pass *p, bool holds);

/* One number, with as many bytes in the frame as its type has. */
void plr_pass_u8(plr_pass *p, uint8_t *value);
void plr_pass_u16(plr_pass *p, uint16_t *value);
void plr_pass_u32(plr_pass *p, uint32_t *value);
void plr_pass_u64(plr_pass *p, uint64_t *value);
void plr_pass_f32(plr_pass *p, float *value);

/* n numbers, each 8 bytes in the frame (f64). */
void plr_pass_f64s(plr_pass *p, double *values, unsigned n);

/* n numbers, each of `real_bytes` bytes in the frame: 4 (f32) or 8 (f64). For f32 they are rounded
 * to nearest; a number beyond its range becomes infinite. */
void plr_pass_reals(plr_pass *p, double *values, unsigned n, unsigned real_bytes);

/* A u8 from 0 to `last`; a larger one is PLR_FAULT_MALFORMED. */
void plr_pass_choice(plr_pass *p, uint8_t *value, uint8_t last);

/* A u8 whose bits 0 and 1 are two flags. `second` may be null. The other bits are ignored when read
 * and written as 0. */
void plr_pass_flags(plr_pass *p, bool *first, bool *second);

/* A u8 without a meaning yet: ignored when read, written as 0. */
void plr_pass_reserved(plr_pass *p);

/* Length of a text of at most `size` bytes that may end with a zero. */
size_t plr_pass_text_length(const char *text, size_t size);

/* `length` bytes of text. READ adds a closing zero, text[length]. */
void plr_pass_text(plr_pass *p, char *text, size_t length);

#endif
