// SPDX-License-Identifier: MIT
#include "record/fields.h"

#include <string.h>

static unsigned width(plr_field_kind kind) {
    switch (kind) {
    case PLR_FIELD_FLAG:
    case PLR_FIELD_U8:
        return 1;
    case PLR_FIELD_U16:
        return 2;
    case PLR_FIELD_U32:
        return 4;
    case PLR_FIELD_U64:
    case PLR_FIELD_F64:
        return 8;
    case PLR_FIELD_REAL:
        return sizeof(plr_real);
    }
    return 0;
}

uint32_t plr_fields_size(const plr_field *fields, unsigned n) {
    uint32_t size = 0;
    for (unsigned i = 0; i < n; i++)
        size += fields[i].count * width(fields[i].kind);
    return size;
}

/* The bits of a number as the processor holds it. */
static uint64_t load(const unsigned char *number, unsigned bytes) {
    uint16_t two;
    uint32_t four;
    uint64_t eight;
    switch (bytes) {
    case 1:
        return *number;
    case 2:
        memcpy(&two, number, sizeof two);
        return two;
    case 4:
        memcpy(&four, number, sizeof four);
        return four;
    default:
        memcpy(&eight, number, sizeof eight);
        return eight;
    }
}

static void store(unsigned char *number, unsigned bytes, uint64_t bits) {
    const uint16_t two = (uint16_t)bits;
    const uint32_t four = (uint32_t)bits;
    switch (bytes) {
    case 1:
        *number = (unsigned char)bits;
        break;
    case 2:
        memcpy(number, &two, sizeof two);
        break;
    case 4:
        memcpy(number, &four, sizeof four);
        break;
    default:
        memcpy(number, &bits, sizeof bits);
        break;
    }
}

/* By its exponent: no arithmetic touches the number, so its bits stay. */
static bool is_finite(uint64_t bits, unsigned bytes) {
    const uint64_t exponent = bytes == 4 ? 0x7F800000U : UINT64_C(0x7FF0000000000000);
    return (bits & exponent) != exponent;
}

static plr_status judge(plr_field_kind kind, uint64_t bits) {
    if (kind == PLR_FIELD_FLAG && bits > 1)
        return PLR_E_ARGUMENT;
    const bool is_number = kind == PLR_FIELD_F64 || kind == PLR_FIELD_REAL;
    return is_number && !is_finite(bits, width(kind)) ? PLR_E_NOT_FINITE : PLR_OK;
}

/* ---------------------------------------------------------------- writing */

void plr_fields_flush(plr_fields_out *out) {
    if (out->status == PLR_OK && out->fill > 0 && out->sink &&
        out->sink(out->context, out->buffer, out->fill) != 0)
        out->status = PLR_E_IO;
    out->fill = 0;
}

static void put_byte(plr_fields_out *out, uint8_t byte) {
    out->buffer[out->fill++] = byte;
    if (out->fill == sizeof out->buffer)
        plr_fields_flush(out);
}

void plr_fields_put(plr_fields_out *out, const void *object, const plr_field *fields, unsigned n) {
    for (const plr_field *field = fields; field < fields + n; field++) {
        const unsigned bytes = width(field->kind);
        const unsigned char *number = (const unsigned char *)object + field->offset;
        for (uint32_t i = 0; i < field->count && out->status == PLR_OK; i++) {
            const uint64_t bits = load(number + (size_t)i * bytes, bytes);
            out->status = judge(field->kind, bits);
            for (unsigned byte = 0; byte < bytes; byte++)
                put_byte(out, (uint8_t)(bits >> (8 * byte) & 0xFF));
        }
    }
}

/* ---------------------------------------------------------------- reading */

static void fail(plr_fields_in *in, plr_status status) {
    if (in->status == PLR_OK)
        in->status = status;
}

static void refill(plr_fields_in *in) {
    const uint32_t left = in->length - in->at;
    const unsigned n = left < sizeof in->buffer ? (unsigned)left : (unsigned)sizeof in->buffer;
    in->first = in->fill = 0;
    if (n == 0) {
        fail(in, PLR_E_CORRUPT);
    } else if (in->source(in->context, in->at, in->buffer, n) != 0) {
        fail(in, PLR_E_IO);
    } else {
        in->at += n;
        in->fill = n;
    }
}

/* The next number's bits; 0 after a fault. */
static uint64_t get_bits(plr_fields_in *in, unsigned bytes) {
    uint64_t bits = 0;
    for (unsigned byte = 0; byte < bytes; byte++) {
        if (in->first == in->fill && in->status == PLR_OK)
            refill(in);
        if (in->status != PLR_OK)
            return 0;
        bits |= (uint64_t)in->buffer[in->first++] << (8 * byte);
    }
    return bits;
}

void plr_fields_get(plr_fields_in *in, void *object, const plr_field *fields, unsigned n) {
    for (const plr_field *field = fields; field < fields + n; field++) {
        const unsigned bytes = width(field->kind);
        for (uint32_t i = 0; i < field->count; i++) {
            uint64_t bits = get_bits(in, bytes);
            if (judge(field->kind, bits) != PLR_OK) {
                fail(in, PLR_E_CORRUPT);
                bits = 0;
            }
            if (object)
                store((unsigned char *)object + field->offset + (size_t)i * bytes, bytes, bits);
        }
    }
}

bool plr_fields_match(plr_fields_in *in, const void *object, const plr_field *fields, unsigned n) {
    bool same = true;
    for (const plr_field *field = fields; field < fields + n; field++) {
        const unsigned bytes = width(field->kind);
        const unsigned char *number = (const unsigned char *)object + field->offset;
        for (uint32_t i = 0; i < field->count; i++)
            same &= get_bits(in, bytes) == load(number + (size_t)i * bytes, bytes);
    }
    return same;
}
