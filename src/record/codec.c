// SPDX-License-Identifier: MIT
#include "record/codec.h"

#include <string.h>

#include "pelorus/assertions.h"
#include "pelorus/config.h"
#include "pelorus/wire.h"
#include "record/bytes.h"

void plr_codec_fail(plr_codec *c, plr_status status) {
    if (c->status == PLR_OK)
        c->status = status;
}

bool plr_codec_take(void *context, uint8_t *bytes, unsigned n) {
    const uint8_t **next = context;
    memcpy(bytes, *next, n);
    *next += n;
    return true;
}

static void require(plr_codec *c, bool holds) {
    if (!holds)
        plr_codec_fail(c, PLR_E_ARGUMENT);
}

/* Moves n bytes. After a fault nothing is written, and zeros are read. */
static void move(plr_codec *c, uint8_t *bytes, unsigned n) {
    const bool reads = plr_codec_reads(c);
    require(c, !reads || c->left >= n);
    if (c->status == PLR_OK && c->direction != PLR_CODEC_CHECK && !c->move(c->context, bytes, n))
        plr_codec_fail(c, PLR_E_IO);
    if (!reads)
        return;
    if (c->status == PLR_OK)
        c->left -= n;
    else
        memset(bytes, 0, n);
}

/* ---------------------------------------------------------------- numbers */

/* Bytes of one number in memory, by its kind. */
static unsigned size_in_memory(unsigned kind) {
    switch (kind) {
    case PLR_FIELD_U16:
        return 2;
    case PLR_FIELD_U32:
    case PLR_FIELD_F32:
        return 4;
    case PLR_FIELD_U64:
    case PLR_FIELD_F64:
    case PLR_FIELD_NARROW:
    case PLR_FIELD_PRECISE:
        return 8;
    case PLR_FIELD_REAL:
        return sizeof(plr_real);
    default:
        return 1;
    }
}

/* A number as the processor holds it becomes little-endian bytes, or the other way round. */
static void reorder(unsigned char *to, const unsigned char *from, unsigned width) {
    PLR_ASSERT(width <= 8);
    const uint16_t one = 1;
    const bool is_little = *(const unsigned char *)&one == 1;
    for (unsigned i = 0; i < width; i++)
        to[i] = from[is_little ? i : width - 1 - i];
}

/* By its exponent: no arithmetic touches the number, so its bits stay. */
static bool is_finite(const uint8_t *bytes, unsigned width) {
    const uint64_t exponent = width == 4 ? 0x7F80U : 0x7FF0U; /* of the two highest bytes */
    return (plr_bytes_get(bytes + width - 2, 2) & exponent) != exponent;
}

static bool is_whole(unsigned kind) {
    return kind <= PLR_FIELD_U64;
}

static void judge(plr_codec *c, const plr_field *f, const uint8_t *bytes, unsigned width) {
    if (f->most > 0) {
        const uint64_t number = plr_bytes_get(bytes, width);
        require(c, number >= f->least && number <= f->most);
    } else if (c->finite && !is_whole(f->kind) && !is_finite(bytes, width)) {
        plr_codec_fail(c, PLR_E_NOT_FINITE);
    }
}

/* One number that has the same bits in memory and outside. */
static void pass_same(plr_codec *c, const plr_field *f, unsigned char *at) {
    const unsigned width = size_in_memory(f->kind);
    uint8_t bytes[8], own[8];
    if (!plr_codec_reads(c)) {
        reorder(bytes, at, width);
        judge(c, f, bytes, width);
        move(c, bytes, width);
        return;
    }
    move(c, bytes, width);
    if (c->direction == PLR_CODEC_MATCH) {
        reorder(own, at, width);
        c->differs = c->differs || memcmp(own, bytes, width) != 0;
        return;
    }
    judge(c, f, bytes, width);
    if (c->status != PLR_OK)
        memset(bytes, 0, width);
    if (at)
        reorder(at, bytes, width);
}

/* A double that is f32 outside: rounded to nearest, infinite beyond the range (C99 Annex F.3). */
static void pass_narrow(plr_codec *c, unsigned char *at) {
    static const plr_field f32 = {.kind = PLR_FIELD_F32, .count = 1};
    double wide = 0;
    memcpy(&wide, at, sizeof wide);
    float narrow = plr_codec_reads(c) ? 0.0F : (float)wide;
    pass_same(c, &f32, (unsigned char *)&narrow);
    wide = (double)narrow;
    if (plr_codec_reads(c))
        memcpy(at, &wide, sizeof wide);
}

static void pass_number(plr_codec *c, const plr_field *f, unsigned char *at) {
    if (f->kind == PLR_FIELD_NARROW || (f->kind == PLR_FIELD_PRECISE && c->real_bytes == 4))
        pass_narrow(c, at);
    else
        pass_same(c, f, at);
}

void plr_codec_numbers(plr_codec *c, plr_field_kind kind, void *numbers, uint32_t count) {
    const plr_field f = {.kind = (uint8_t)kind};
    PLR_ASSERT(kind <= PLR_FIELD_PRECISE);
    for (uint32_t i = 0; i < count && c->status == PLR_OK; i++)
        pass_number(c, &f, numbers ? (unsigned char *)numbers + i * size_in_memory(kind) : NULL);
}

void plr_codec_bytes(plr_codec *c, const uint8_t **bytes, unsigned n) {
    if (c->direction == PLR_CODEC_WRITE) {
        move(c, (uint8_t *)*bytes, n);
        return;
    }
    PLR_ASSERT(c->direction == PLR_CODEC_CHECK || c->move == plr_codec_take);
    require(c, c->direction == PLR_CODEC_CHECK ? *bytes != NULL : c->left >= n);
    if (c->direction == PLR_CODEC_CHECK || c->status != PLR_OK)
        return;
    const uint8_t **next = c->context;
    *bytes = *next;
    *next += n;
    c->left -= n;
}

/* A 3x3 matrix by its lower triangle, row by row. */
static void pass_symmetric(plr_codec *c, unsigned char *at) {
    double A[9];
    memcpy(A, at, sizeof A);
    for (unsigned row = 0; row < 3; row++)
        plr_codec_numbers(c, PLR_FIELD_F64, &A[3 * row], row + 1);
    A[1] = A[3];
    A[2] = A[6];
    A[5] = A[7];
    if (plr_codec_reads(c))
        memcpy(at, A, sizeof A);
}

/* ---------------------------------------------------------------- other fields */

/* A u8 outside. */
static uint8_t pass_byte(plr_codec *c, unsigned value) {
    uint8_t byte = (uint8_t)(value & 0xFF);
    move(c, &byte, 1);
    return byte;
}

static void pass_status(plr_codec *c, unsigned char *at) {
    plr_status status = PLR_OK;
    memcpy(&status, at, sizeof status);
    int number = plr_codec_reads(c) ? 0 : (int)status;
    const uint8_t bits = pass_byte(c, (unsigned)number);
    if (plr_codec_reads(c))
        number = bits <= INT8_MAX ? bits : bits - 256;
    require(c, number <= PLR_OK && number >= INT8_MIN);
    status = (plr_status)number;
    if (plr_codec_reads(c))
        memcpy(at, &status, sizeof status);
}

static void pass_health(plr_codec *c, unsigned char *at) {
    plr_health health = PLR_HEALTH_GOOD;
    if (!plr_codec_reads(c))
        memcpy(&health, at, sizeof health);
    const uint8_t bits = pass_byte(c, (unsigned)health);
    if (plr_codec_reads(c))
        health = (plr_health)bits;
    require(c, (unsigned)health <= PLR_HEALTH_DIVERGED);
    if (plr_codec_reads(c))
        memcpy(at, &health, sizeof health);
}

static void pass_half(plr_codec *c, bool upper, unsigned char *at) {
    uint32_t whole = 0;
    if (!plr_codec_reads(c) || upper)
        memcpy(&whole, at, sizeof whole);
    uint8_t bytes[2];
    plr_bytes_put(bytes, 2, upper ? whole >> 16 : whole & 0xFFFF);
    move(c, bytes, 2);
    const uint32_t half = (uint32_t)plr_bytes_get(bytes, 2);
    whole = upper ? half << 16 | (whole & 0xFFFF) : half;
    if (plr_codec_reads(c))
        memcpy(at, &whole, sizeof whole);
}

/* Bits without a flag are ignored when read, and written as 0. */
static void pass_bits(plr_codec *c, unsigned count, unsigned char *at) {
    bool *flags = (bool *)at;
    unsigned bits = 0;
    for (unsigned i = 0; i < count && !plr_codec_reads(c); i++)
        bits |= (flags[i] ? 1U : 0U) << i;
    bits = pass_byte(c, bits);
    for (unsigned i = 0; i < count && plr_codec_reads(c); i++)
        flags[i] = (bits >> i & 1) != 0;
}

/* The first two bytes of a HEADER mean the same in every version; a writer writes its own. */
static void pass_version(plr_codec *c, unsigned char *at) {
    const uint8_t major = pass_byte(c, PLR_WIRE_VERSION_MAJOR);
    const uint8_t minor = pass_byte(c, PLR_WIRE_VERSION_MINOR);
    if (major > PLR_WIRE_VERSION_MAJOR)
        plr_codec_fail(c, PLR_E_FOREIGN);
    require(c, major == PLR_WIRE_VERSION_MAJOR);
    if (plr_codec_reads(c)) {
        at[0] = major;
        at[1] = minor;
    }
}

static void pass_real_bytes(plr_codec *c, unsigned char *at) {
    c->real_bytes = pass_byte(c, *at);
    require(c, c->real_bytes == 4 || c->real_bytes == 8);
    if (plr_codec_reads(c))
        *at = c->real_bytes;
}

static size_t length_of(const char *text, size_t size) {
    size_t n = 0;
    while (n < size && text[n] != '\0')
        n++;
    return n;
}

static void pass_characters(plr_codec *c, char *text, unsigned length, bool is_cut) {
    for (unsigned i = 0; i < length && c->status == PLR_OK; i++) {
        const char character = (char)pass_byte(c, (uint8_t)text[i]);
        if (plr_codec_reads(c))
            text[i] = character;
    }
    if (!plr_codec_reads(c) || c->status != PLR_OK)
        return;
    text[length] = is_cut ? (char)pass_byte(c, 0) : '\0';
    unsigned end = length; /* of a character of UTF-8 that is cut, up to three bytes go too */
    while (is_cut && end > 0 && end > length - 3 && ((uint8_t)text[end] & 0xC0) == 0x80)
        end--;
    text[end] = '\0';
}

/* REST, and the length of a TEXT. */
static void pass_text(plr_codec *c, const plr_field *f, char *text) {
    size_t length = c->left;
    if (!plr_codec_reads(c))
        length = length_of(text, (size_t)f->most + 1);
    if (f->kind == PLR_FIELD_LENGTH) {
        c->length = pass_byte(c, (unsigned)length);
        require(c, c->length <= f->most);
        return;
    }
    const bool is_cut = plr_codec_reads(c) && length > f->most;
    require(c, is_cut || length <= f->most);
    pass_characters(c, text, is_cut ? f->most : (unsigned)length, is_cut);
}

/* ---------------------------------------------------------------- tables */

static void pass_field(plr_codec *c, const plr_field *f, unsigned char *at) {
    switch (f->kind) {
    case PLR_FIELD_REAL_BYTES:
        pass_real_bytes(c, at);
        break;
    case PLR_FIELD_SYMMETRIC:
        pass_symmetric(c, at);
        break;
    case PLR_FIELD_HEALTH:
        pass_health(c, at);
        break;
    case PLR_FIELD_STATUS:
        pass_status(c, at);
        break;
    case PLR_FIELD_LOWER:
    case PLR_FIELD_UPPER:
        pass_half(c, f->kind == PLR_FIELD_UPPER, at);
        break;
    case PLR_FIELD_BITS:
        pass_bits(c, f->count, at);
        break;
    case PLR_FIELD_VERSION:
        pass_version(c, at);
        break;
    case PLR_FIELD_ZERO:
        require(c, pass_byte(c, 0) == 0);
        break;
    case PLR_FIELD_SPARE:
        (void)pass_byte(c, 0);
        break;
    case PLR_FIELD_TEXT:
        pass_characters(c, (char *)at, c->length, false);
        break;
    case PLR_FIELD_LENGTH:
    case PLR_FIELD_REST:
        pass_text(c, f, (char *)at);
        break;
    default:
        if (c->direction == PLR_CODEC_CHECK && !c->finite && !is_whole(f->kind))
            break; /* any number will do */
        for (unsigned i = 0; i < f->count; i++)
            pass_number(c, f, at ? at + i * size_in_memory(f->kind) : NULL);
        break;
    }
}

/* READ: the bytes end before the field, which a later version added. */
static void set_unknown(const plr_field *f, unsigned char *at) {
    static const double unknown = -1;
    static const float narrow = -1;
    PLR_ASSERT(at);
    for (unsigned i = 0; i < f->count; i++) {
        if (f->kind == PLR_FIELD_F64 || f->kind == PLR_FIELD_NARROW)
            memcpy(at + i * sizeof unknown, &unknown, sizeof unknown);
        else if (f->kind == PLR_FIELD_F32)
            memcpy(at + i * sizeof narrow, &narrow, sizeof narrow);
        else if (is_whole(f->kind))
            memset(at + i * size_in_memory(f->kind), 0, size_in_memory(f->kind));
    }
}

void plr_codec_fields(plr_codec *c, void *object, const plr_field *fields, unsigned n) {
    unsigned since = 0;
    bool absent = false;
    for (const plr_field *f = fields; f < fields + n; f++) {
        unsigned char *at = object ? (unsigned char *)object + f->offset : NULL;
        absent = absent || (f->since > since && plr_codec_reads(c) && c->left == 0);
        since = f->since;
        if (absent && c->status == PLR_OK)
            set_unknown(f, at);
        else
            pass_field(c, f, at);
    }
}

uint32_t plr_codec_size(const plr_field *fields, unsigned n) {
    uint32_t size = 0;
    for (unsigned i = 0; i < n; i++)
        size += fields[i].count * size_in_memory(fields[i].kind);
    return size;
}
