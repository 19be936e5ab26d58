// SPDX-License-Identifier: MIT
#include "record/pass.h"

#include "pelorus/assertions.h"
#include "record/bytes.h"
#include "record/frame_out.h"

void plr_pass_fail(plr_pass *p, plr_fault fault) {
    if (p->fault == PLR_FAULT_NONE)
        p->fault = fault;
}

void plr_pass_require(plr_pass *p, bool holds) {
    if (!holds)
        plr_pass_fail(p, PLR_FAULT_MALFORMED);
}

/* READ: the next n <= 8 bytes as a number; 0 after a fault. */
static uint64_t take(plr_pass *p, unsigned n) {
    plr_pass_require(p, p->left >= n);
    if (p->fault != PLR_FAULT_NONE)
        return 0;
    uint64_t value = plr_bytes_get(p->payload, n);
    p->payload += n;
    p->left -= n;
    return value;
}

/* WRITE: sends the lowest n <= 8 bytes. CHECK: nothing. */
static void give(plr_pass *p, uint64_t value, unsigned n) {
    if (p->direction != PLR_PASS_WRITE)
        return;
    uint8_t bytes[8];
    plr_bytes_put(bytes, n, value);
    plr_frame_out_put(p->writer, bytes, n);
}

void plr_pass_u8(plr_pass *p, uint8_t *value) {
    if (plr_pass_reads(p))
        *value = (uint8_t)take(p, 1);
    else
        give(p, *value, 1);
}

void plr_pass_u16(plr_pass *p, uint16_t *value) {
    if (plr_pass_reads(p))
        *value = (uint16_t)take(p, 2);
    else
        give(p, *value, 2);
}

void plr_pass_u32(plr_pass *p, uint32_t *value) {
    if (plr_pass_reads(p))
        *value = (uint32_t)take(p, 4);
    else
        give(p, *value, 4);
}

void plr_pass_u64(plr_pass *p, uint64_t *value) {
    if (plr_pass_reads(p))
        *value = take(p, 8);
    else
        give(p, *value, 8);
}

void plr_pass_f32(plr_pass *p, float *value) {
    if (plr_pass_reads(p))
        plr_f32_of_bits(value, (uint32_t)take(p, 4));
    else
        give(p, plr_bits_of_f32(value), 4);
}

void plr_pass_f64s(plr_pass *p, double *values, unsigned n) {
    for (unsigned i = 0; i < n; i++) {
        if (plr_pass_reads(p))
            plr_f64_of_bits(&values[i], take(p, 8));
        else
            give(p, plr_bits_of_f64(&values[i]), 8);
    }
}

/* A conversion by IEEE 754 (C99 Annex F.3): to nearest, and to infinity beyond the range. */
static void pass_f32_of_f64(plr_pass *p, double *value) {
    float narrow = plr_pass_reads(p) ? 0.0F : (float)*value;
    plr_pass_f32(p, &narrow);
    if (plr_pass_reads(p))
        *value = (double)narrow;
}

void plr_pass_reals(plr_pass *p, double *values, unsigned n, unsigned real_bytes) {
    PLR_ASSERT(real_bytes == 4 || real_bytes == 8 || p->fault != PLR_FAULT_NONE);
    if (real_bytes == 8) {
        plr_pass_f64s(p, values, n);
        return;
    }
    for (unsigned i = 0; i < n; i++)
        pass_f32_of_f64(p, &values[i]);
}

void plr_pass_choice(plr_pass *p, uint8_t *value, uint8_t last) {
    plr_pass_u8(p, value);
    plr_pass_require(p, *value <= last);
}

void plr_pass_flags(plr_pass *p, bool *first, bool *second) {
    if (plr_pass_reads(p)) {
        uint64_t bits = take(p, 1);
        *first = (bits & 1) != 0;
        if (second)
            *second = (bits & 2) != 0;
    } else {
        unsigned low = *first ? 1 : 0, high = second && *second ? 2 : 0;
        give(p, low | high, 1);
    }
}

void plr_pass_reserved(plr_pass *p) {
    uint8_t zero = 0;
    plr_pass_u8(p, &zero);
}

size_t plr_pass_text_length(const char *text, size_t size) {
    size_t n = 0;
    while (n < size && text[n] != '\0')
        n++;
    return n;
}

void plr_pass_text(plr_pass *p, char *text, size_t length) {
    for (size_t i = 0; i < length; i++) {
        if (plr_pass_reads(p))
            text[i] = (char)take(p, 1);
        else
            give(p, (uint8_t)text[i], 1);
    }
    if (plr_pass_reads(p))
        text[length] = '\0';
}
