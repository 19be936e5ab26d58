// SPDX-License-Identifier: MIT
#include "session/line.h"

#include <string.h>

#include "pelorus/assertions.h"

/* The length of UTF-8 text when it is cut to `room` bytes: never inside a character. */
static size_t whole_characters(const char *added, size_t room) {
    size_t n = 0;
    while (n < room && added[n] != '\0')
        n++;
    if (added[n] != '\0')
        while (n > 0 && ((unsigned char)added[n] & 0xC0u) == 0x80u)
            n--;
    return n;
}

void plr_line_text(plr_text *line, const char *added) {
    const size_t at = strlen(line->text);
    PLR_ASSERT(at <= PLR_WIRE_MAX_TEXT);
    const size_t n = whole_characters(added, PLR_WIRE_MAX_TEXT - at);
    memcpy(line->text + at, added, n);
    line->text[at + n] = '\0';
}

void plr_line_begin(plr_text *line, plr_severity severity, const char *words) {
    line->severity = (uint8_t)severity;
    line->text[0] = '\0';
    plr_line_text(line, words);
}

/* Decimal digits of a number, at least `width` of them. */
static void put_digits(plr_text *line, uint64_t number, unsigned width) {
    char digits[21];
    unsigned at = sizeof digits - 1;
    PLR_ASSERT(width <= at);
    digits[at] = '\0';
    for (unsigned n = 0; number > 0 || n < width; n++) {
        digits[--at] = (char)('0' + number % 10u);
        number /= 10u;
    }
    plr_line_text(line, digits + at);
}

void plr_line_count(plr_text *line, const char *before, uint64_t number) {
    plr_line_text(line, before);
    put_digits(line, number, 1);
}

/* digits 10^-decimals, without the zeros at its end. */
static void put_decimal(plr_text *line, uint32_t digits, unsigned decimals) {
    PLR_ASSERT(digits < 1000000u && decimals <= 9);
    while (decimals > 0 && digits % 10u == 0) {
        digits /= 10u;
        decimals--;
    }
    uint32_t unit = 1;
    for (unsigned i = 0; i < decimals; i++)
        unit *= 10u;
    put_digits(line, digits / unit, 1);
    if (decimals > 0) {
        plr_line_text(line, ".");
        put_digits(line, digits % unit, decimals);
    }
}

void plr_line_number(plr_text *line, double number) {
    if (number != number) {
        plr_line_text(line, "NaN");
        return;
    }
    if (number < 0) {
        plr_line_text(line, "-");
        number = -number;
    }
    if (number > 1.7e308) {
        plr_line_text(line, "infinity");
        return;
    }
    int exponent = 0; /* number 10^exponent was asked for, with number in [1, 10) */
    if (number > 0) {
        for (; number >= 10; exponent++)
            number /= 10;
        for (; number < 1; exponent--)
            number *= 10;
    }
    uint32_t digits = (uint32_t)(number * 1e5 + 0.5);
    if (digits >= 1000000u) {
        digits /= 10u;
        exponent++;
    }
    if (exponent >= -4 && exponent <= 5) {
        put_decimal(line, digits, (unsigned)(5 - exponent));
    } else {
        put_decimal(line, digits, 5);
        plr_line_text(line, exponent < 0 ? "e-" : "e+");
        put_digits(line, (uint64_t)(exponent < 0 ? -exponent : exponent), 2);
    }
}

void plr_line_time(plr_text *line, plr_time_ns t_ns) {
    put_digits(line, t_ns / 1000000000u, 1);
    plr_line_text(line, ".");
    put_digits(line, t_ns / 1000000u % 1000u, 3);
    plr_line_text(line, " s");
}
