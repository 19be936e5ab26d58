// SPDX-License-Identifier: MIT
/*
 * A pass goes through a message's fields in the order of the wire. Its direction decides what that
 * does: READ fills the fields from a payload, WRITE sends them, CHECK touches nothing and finds
 * out whether WRITE would be right. So every layout (layout.h) is written down once.
 *
 * A fault stays: what is read after it is zero, and the message is not to be used.
 */
#ifndef PELORUS_WIRE_PASS_H
#define PELORUS_WIRE_PASS_H

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

/* One number, of the type's own width on the wire. */
void plr_pass_u8(plr_pass *p, uint8_t *value);
void plr_pass_u16(plr_pass *p, uint16_t *value);
void plr_pass_u32(plr_pass *p, uint32_t *value);
void plr_pass_u64(plr_pass *p, uint64_t *value);
void plr_pass_f32(plr_pass *p, float *value);

/* n numbers, f64 on the wire. */
void plr_pass_f64s(plr_pass *p, double *values, unsigned n);

/* n numbers, on the wire of `real_bytes` bytes each: 4 or 8. Rounded to nearest for f32; what is
 * beyond its range becomes infinite. */
void plr_pass_reals(plr_pass *p, double *values, unsigned n, unsigned real_bytes);

/* A u8 from 0 to `last`; else malformed. */
void plr_pass_choice(plr_pass *p, uint8_t *value, uint8_t last);

/* A u8: bit 0 and bit 1. `second` may be null. Bits unknown here are ignored, and written as 0. */
void plr_pass_flags(plr_pass *p, bool *first, bool *second);

/* A u8 that has no meaning yet: ignored, and written as 0. */
void plr_pass_reserved(plr_pass *p);

/* Bytes of text before the closing zero; `size` if there is none. */
size_t plr_pass_text_length(const char *text, size_t size);

/* `length` bytes of text; text[length] = 0 is put behind what is read. */
void plr_pass_text(plr_pass *p, char *text, size_t length);

#endif
