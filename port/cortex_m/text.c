// SPDX-License-Identifier: MIT
#include "text.h"

#include "serial.h"

void text_clear(text *t) {
    t->length = 0;
    t->characters[0] = '\0';
}

static void add_character(text *t, char c) {
    if (t->length + 1 < sizeof t->characters) {
        t->characters[t->length++] = c;
        t->characters[t->length] = '\0';
    }
}

void text_add(text *t, const char *words) {
    while (*words != '\0') {
        add_character(t, *words++);
    }
}

void text_add_number(text *t, uint64_t number) {
    char digits[20];
    unsigned count = 0;
    do {
        digits[count++] = (char)('0' + (char)(number % 10));
        number /= 10;
    } while (number != 0);
    while (count > 0) {
        add_character(t, digits[--count]);
    }
}

void text_add_hex(text *t, uint32_t number) {
    text_add(t, "0x");
    for (int shift = 28; shift >= 0; shift -= 4) {
        add_character(t, "0123456789abcdef"[(number >> shift) & 15]);
    }
}

void text_add_field(text *t, const char *name, uint64_t number) {
    text_add(t, name);
    text_add(t, " ");
    text_add_number(t, number);
    text_add(t, " ");
}

void text_put_line(text *t) {
    text_add(t, "\n");
    serial_panic((const uint8_t *)t->characters, t->length);
    text_clear(t);
}
