// SPDX-License-Identifier: MIT
#include <string.h>

#include "schema/print.h"

static const struct {
    const char *kind, *outside;
    unsigned bytes;
} types[] = {
    {"U8", "u8", 1},        {"U16", "u16", 2},   {"U32", "u32", 4},       {"U64", "u64", 8},
    {"F32", "f32", 4},      {"F64", "f64", 8},   {"REAL", "real", 0},     {"NARROW", "f32", 4},
    {"PRECISE", "real", 0}, {"HEALTH", "u8", 1}, {"REAL_BYTES", "u8", 1}, {"SYMMETRIC", "f64", 8},
    {"STATUS", "i8", 1},    {"LOWER", "u16", 2}, {"UPPER", "u16", 2},     {"BITS", "u8", 1},
    {"VERSION", "u8", 1},   {"ZERO", "u8", 1},   {"SPARE", "u8", 1},      {"LENGTH", "u8", 1},
    {"TEXT", "text", 0},    {"REST", "text", 0},
};

static size_t find(const row *field) {
    size_t i = 0;
    while (strcmp(types[i].kind, field->type) != 0)
        i++;
    return i;
}

const char *schema_type(const row *field) {
    return types[find(field)].outside;
}

unsigned schema_bytes(const row *field) {
    return types[find(field)].bytes;
}

const char *schema_short_name(const word *w) {
    static const char prefix[] = "PLR_";
    if (strncmp(w->name, prefix, sizeof prefix - 1) != 0)
        return w->name;
    const char *name = w->name + sizeof prefix - 1, *line = strchr(name, '_');
    return line ? line + 1 : name;
}
