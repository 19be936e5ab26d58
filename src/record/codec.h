// SPDX-License-Identifier: MIT
/*
 * A record is a table of fields. A codec walks the table and moves the numbers between a struct and
 * bytes, which are little-endian and without gaps: what is stored or sent does not depend on a
 * compiler's padding or on the processor's byte order. Messages (messages.h) and the saved state
 * (filter/snapshot.c) use the same codec.
 *
 * The first fault is kept in `status`: what is read after it is zero, and nothing more is written.
 */
#ifndef PLR_RECORD_CODEC_H
#define PLR_RECORD_CODEC_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pelorus/types.h"

typedef enum plr_field_kind {
    /* Numbers that have the same type in memory and as bytes. */
    PLR_FIELD_U8,
    PLR_FIELD_U16,
    PLR_FIELD_U32,
    PLR_FIELD_U64,
    PLR_FIELD_F32,
    PLR_FIELD_F64,
    PLR_FIELD_REAL, /* plr_real: 4 or 8 bytes */
    /* Others. */
    PLR_FIELD_NARROW,     /* double; as bytes f32. Rounded to nearest, beyond the range infinite */
    PLR_FIELD_PRECISE,    /* double; as bytes f32 or f64, as the last REAL_BYTES said */
    PLR_FIELD_REAL_BYTES, /* u8: 4 or 8 */
    PLR_FIELD_SYMMETRIC,  /* 3x3 double; as bytes its lower triangle, 6 f64 */
    PLR_FIELD_HEALTH,     /* plr_health; as bytes u8 */
    PLR_FIELD_STATUS,     /* plr_status; as bytes i8. Not above 0; unknown ones are let through */
    PLR_FIELD_LOWER,      /* bits 0 to 15 of a uint32_t; as bytes u16 */
    PLR_FIELD_UPPER,      /* bits 16 to 31 of a uint32_t whose LOWER comes before */
    PLR_FIELD_BITS,       /* bools, one behind the other; as bytes bits of one u8 */
    PLR_FIELD_VERSION,    /* two u8, the format's major and minor version */
    PLR_FIELD_ZERO,       /* not in memory; as bytes a u8 that must be 0 */
    PLR_FIELD_SPARE,      /* not in memory; as bytes a u8, written as 0 and ignored */
    PLR_FIELD_LENGTH,     /* of the text that comes later: u8 */
    PLR_FIELD_TEXT,       /* characters, as many as LENGTH said; a zero is added when read */
    PLR_FIELD_REST        /* characters up to the end; longer texts are cut when read */
} plr_field_kind;

typedef struct plr_field {
    uint32_t offset; /* in the struct */
    uint16_t most;   /* greatest value of a whole number, 0: any; of a text its greatest length */
    uint8_t kind;    /* plr_field_kind */
    uint8_t count;   /* numbers, one behind the other */
    uint8_t least;   /* least value, where there is a greatest one */
    uint8_t since;   /* minor version that added it at the end. Where the bytes end before it, whole
                        numbers are 0 and others -1 */
} plr_field;

typedef enum plr_direction {
    PLR_CODEC_CHECK, /* find out whether the struct can be written */
    PLR_CODEC_WRITE,
    PLR_CODEC_READ, /* into the struct; if it is NULL: look at the numbers, and drop them */
    PLR_CODEC_MATCH /* read, and compare with the struct */
} plr_direction;

/* Moves n bytes, 1 to 8, from where `context` says or to there. Returns false for a failure. */
typedef bool (*plr_codec_move)(void *context, uint8_t *bytes, unsigned n);

typedef struct plr_codec {
    plr_direction direction;
    plr_status status; /* PLR_E_ARGUMENT too short, or a value that is not allowed;
                          PLR_E_NOT_FINITE; PLR_E_FOREIGN a later major version; PLR_E_IO move has
                          failed */
    bool finite;       /* NaN and infinity are not allowed */
    bool differs;      /* MATCH: a number is another one than in the struct */
    plr_codec_move move;
    void *context;
    size_t left; /* READ, MATCH: bytes that there are still */

    /* What numbers say of those that follow. */
    uint8_t real_bytes;
    uint8_t length; /* of a text */
} plr_codec;

static inline bool plr_codec_reads(const plr_codec *c) {
    return c->direction >= PLR_CODEC_READ;
}

/* Records a fault, unless there was one before. */
void plr_codec_fail(plr_codec *c, plr_status status);

/* A plr_codec_move that reads: `context` points to a pointer to the next byte. */
bool plr_codec_take(void *context, uint8_t *bytes, unsigned n);

/* Passes n fields of a struct, in the order of the table. Only READ changes the struct. */
void plr_codec_fields(plr_codec *c, void *object, const plr_field *fields, unsigned n);

/* Passes `count` numbers, one behind the other, of one of the first kinds. */
void plr_codec_numbers(plr_codec *c, plr_field_kind kind, void *numbers, uint32_t count);

/* Passes n bytes as they are. READ: *bytes becomes where they lie, and `move` must be plr_codec_take. */
void plr_codec_bytes(plr_codec *c, const uint8_t **bytes, unsigned n);

/* Bytes of n fields of the first kinds. */
uint32_t plr_codec_size(const plr_field *fields, unsigned n);

#endif
