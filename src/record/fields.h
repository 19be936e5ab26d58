// SPDX-License-Identifier: MIT
/*
 * The fields of a struct as little-endian bytes, one after another without gaps: what is stored
 * does not depend on a compiler's padding or on the processor's byte order. A layout is a table of
 * fields and is written down once; it can be written, read, and compared.
 *
 * Numbers are copied bit by bit. One that is not finite, and a flag that is neither 0 nor 1, is
 * refused in both directions.
 */
#ifndef PLR_RECORD_FIELDS_H
#define PLR_RECORD_FIELDS_H

#include <stdbool.h>
#include <stddef.h>

#include "pelorus/filter.h"

typedef enum plr_field_kind {
    PLR_FIELD_FLAG, /* uint8_t, 0 or 1 */
    PLR_FIELD_U8,
    PLR_FIELD_U16,
    PLR_FIELD_U32,
    PLR_FIELD_U64,
    PLR_FIELD_F64,
    PLR_FIELD_REAL /* plr_real: 4 or 8 bytes */
} plr_field_kind;

/* `count` numbers of a kind, `offset` bytes from the struct's beginning. */
typedef struct plr_field {
    size_t offset;
    plr_field_kind kind;
    uint32_t count;
} plr_field;

/* Bytes that n fields take when stored. */
uint32_t plr_fields_size(const plr_field *fields, unsigned n);

/* --- writing --- */

typedef struct plr_fields_out {
    plr_state_sink sink; /* NULL: nothing is handed over, only looked at */
    void *context;
    uint8_t buffer[PLR_STATE_CHUNK];
    unsigned fill;
    plr_status status; /* the first fault; after it nothing is handed over */
} plr_fields_out;

/* Appends n fields of `object`. PLR_E_NOT_FINITE, PLR_E_ARGUMENT (a flag), PLR_E_IO. */
void plr_fields_put(plr_fields_out *out, const void *object, const plr_field *fields, unsigned n);

/* Hands over what is still in the buffer. */
void plr_fields_flush(plr_fields_out *out);

/* --- reading --- */

typedef struct plr_fields_in {
    plr_state_source source;
    void *context;
    uint32_t at, length; /* bytes taken from the source, and all that there are */
    uint8_t buffer[PLR_STATE_CHUNK];
    unsigned first, fill;
    plr_status status; /* the first fault; after it numbers are zero */
} plr_fields_in;

/* Reads n fields into `object`; NULL: they are looked at and dropped. PLR_E_CORRUPT a number that
 * put would have refused, or no bytes left; PLR_E_IO. */
void plr_fields_get(plr_fields_in *in, void *object, const plr_field *fields, unsigned n);

/* True if the next fields are those of `object`, to the bit. Reads all of them in any case. */
bool plr_fields_match(plr_fields_in *in, const void *object, const plr_field *fields, unsigned n);

#endif
