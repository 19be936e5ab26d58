// SPDX-License-Identifier: MIT
#include "posix/json.h"

#include <inttypes.h>
#include <math.h>

/* Bytes of the UTF-8 character that begins here, 0 if none does. */
static int utf8_length(const unsigned char *text) {
    const int n = text[0] < 0x80   ? 1
                  : text[0] < 0xc2 ? 0
                  : text[0] < 0xe0 ? 2
                  : text[0] < 0xf0 ? 3
                  : text[0] < 0xf5 ? 4
                                   : 0;
    for (int i = 1; i < n; i++)
        if ((text[i] & 0xc0) != 0x80)
            return 0;
    return n;
}

static void put_character(FILE *file, const unsigned char *text, int length) {
    if (length == 0)
        fputs("\\ufffd", file);
    else if (*text == '"' || *text == '\\')
        fprintf(file, "\\%c", *text);
    else if (*text < 0x20 || *text == 0x7f)
        fprintf(file, "\\u%04x", *text);
    else
        fwrite(text, 1, (size_t)length, file);
}

/* What is not UTF-8 becomes the replacement character. */
static void put_string(FILE *file, const char *text) {
    const unsigned char *at = (const unsigned char *)text;
    fputc('"', file);
    while (*at != '\0') {
        const int length = utf8_length(at);
        put_character(file, at, length);
        at += length > 0 ? length : 1;
    }
    fputc('"', file);
}

static void key(json_object *object, const char *name) {
    fputs(object->begun ? ",\n  " : "{\n  ", object->file);
    object->begun = true;
    put_string(object->file, name);
    fputs(": ", object->file);
}

void json_begin(json_object *object, FILE *file) {
    object->file = file;
    object->begun = false;
}

void json_end(json_object *object) {
    fputs(object->begun ? "\n}\n" : "{}\n", object->file);
}

void json_count(json_object *object, const char *name, uint64_t value) {
    key(object, name);
    fprintf(object->file, "%" PRIu64, value);
}

void json_flag(json_object *object, const char *name, bool value) {
    key(object, name);
    fputs(value ? "true" : "false", object->file);
}

void json_string(json_object *object, const char *name, const char *value) {
    key(object, name);
    put_string(object->file, value);
}

void json_number(json_object *object, const char *name, double value) {
    key(object, name);
    if (isfinite(value))
        fprintf(object->file, "%.9g", value);
    else
        fputs("null", object->file);
}
