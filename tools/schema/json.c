// SPDX-License-Identifier: MIT
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pelorus/settings.h"
#include "pelorus/wire.h"
#include "schema/print.h"

static void print_text(const char *text) {
    putchar('"');
    for (; *text; text++) {
        if (*text == '"' || *text == '\\')
            putchar('\\');
        putchar(*text);
    }
    putchar('"');
}

static void print_pair(const char *key, const char *text) {
    printf("\"%s\": ", key);
    print_text(text);
}

/* The shortest form that is read as the same number. */
static void print_number(double x) {
    char text[40];
    int digits = 1;
    do
        snprintf(text, sizeof text, "%.*g", digits, x);
    while (digits++ < 17 && (strtod(text, NULL) < x || strtod(text, NULL) > x));
    printf("%s", text);
}

/* --- messages --- */

static bool is(const row *field, const char *type) {
    return strcmp(field->type, type) == 0;
}

/* Least and most of a whole number, where it has limits. */
static void print_limits(const row *field) {
    if (is(field, "REAL_BYTES"))
        printf(", \"values\": [4, 8]");
    if (is(field, "STATUS"))
        printf(", \"least\": -128, \"most\": 0");
    if (is(field, "REST") || is(field, "TEXT"))
        printf(", \"most\": %u", field->most);
    else if (field->most > 0 || is(field, "ZERO"))
        printf(", \"least\": %u, \"most\": %u", field->least, field->most);
}

static void print_field(const row *field, const char *name, unsigned count) {
    printf("{");
    print_pair("name", name);
    printf(", \"type\": \"%s\"", schema_type(field));
    if (count > 1)
        printf(", \"count\": %u", count);
    print_limits(field);
    if (field->since > 0)
        printf(", \"since\": %u", field->since);
    if (field->unit[0])
        printf(", "), print_pair("unit", field->unit);
    if (field->about[0])
        printf(", "), print_pair("about", field->about);
    printf("}");
}

static void print_message(const row *first) {
    const char *between = "\n       ";
    printf("    {\"kind\": %u, ", first->number);
    print_pair("name", first->name);
    printf(", ");
    print_pair("from", first->from);
    printf(",\n     ");
    print_pair("about", first->about);
    printf(",\n     \"fields\": [");
    for (const row *r = first + 1; r->kind != ROW_END; r++) {
        if (r->kind == ROW_REPEATED || r->kind == ROW_COLUMNS) {
            printf("],\n     \"%s\": [", r->kind == ROW_COLUMNS ? "columns" : "rows");
            between = "\n       ";
            continue;
        }
        printf("%s", between);
        between = ",\n       ";
        if (is(r, "VERSION")) {
            row major = *r;
            major.least = major.most = PLR_WIRE_VERSION_MAJOR;
            print_field(&major, "version_major", 1);
            printf("%s", between);
            print_field(r, "version_minor", 1);
        } else {
            print_field(r, r->name, is(r, "BITS") ? 1 : r->count);
        }
    }
    printf("]}");
}

static void print_messages(void) {
    const char *between = "";
    printf("  \"messages\": [\n");
    for (size_t i = 0; i < schema_message_rows; i++)
        if (schema_messages[i].kind == ROW_TABLE) {
            printf("%s", between);
            print_message(&schema_messages[i]);
            between = ",\n";
        }
    printf("\n  ],\n");
}

/* --- settings --- */

static void print_words(const plr_setting *s) {
    printf(", \"words\": [");
    for (unsigned i = 0; s->choices[i]; i++)
        printf("%s\"%s\"", i > 0 ? ", " : "", s->choices[i]);
    printf("]");
}

static void print_range(const plr_setting *s) {
    printf(", \"least\": ");
    print_number(s->minimum);
    printf(", \"most\": ");
    print_number(s->maximum);
    printf(", \"default\": ");
    print_number(s->standard);
}

static void print_setting(const plr_setting *s) {
    printf("    {\"id\": %u, ", (unsigned)s->id);
    print_pair("name", s->name);
    printf(", ");
    print_pair("unit", s->unit);
    if (s->choices)
        print_words(s);
    if (s->kind == PLR_SETTING_LIST)
        printf(", \"list\": true");
    if (s->kind != PLR_SETTING_COUNT) /* that one's are the build's */
        print_range(s);
    const plr_setting *whole = plr_setting_of_axis(s);
    if (whole)
        printf(", \"of_axis\": %u", (unsigned)whole->id);
    printf(", ");
    print_pair("about", plr_setting_about(s));
    printf("}");
}

static void print_settings(void) {
    printf("  \"settings\": [\n");
    for (unsigned i = 0; i < plr_setting_count(); i++) {
        print_setting(plr_setting_at(i));
        printf("%s\n", i + 1 < plr_setting_count() ? "," : "");
    }
    printf("  ],\n");
}

/* --- words, names, limits --- */

static void print_word(const word *w) {
    const char *name = schema_short_name(w);
    printf("    {\"of\": \"%s\", \"name\": \"%s\", \"number\": %d", w->of, name, w->number);
    if (w->text[0])
        printf(", "), print_pair("words", w->text);
    printf("}");
}

static void print_all_words(const char *key, const word *words, size_t n, const char *after) {
    printf("  \"%s\": [\n", key);
    for (size_t i = 0; i < n; i++) {
        print_word(&words[i]);
        printf("%s\n", i + 1 < n ? "," : "");
    }
    printf("  ]%s\n", after);
}

static void print_limit_table(void) {
    printf("  \"limits\": {\n");
    for (size_t i = 0; i < schema_limit_rows; i++)
        printf("    \"%s\": %.15g%s\n", schema_limits[i].name, schema_limits[i].value,
               i + 1 < schema_limit_rows ? "," : "");
    printf("  },\n");
}

/* The greatest values that a sensor may give. */
static void print_bounds(void) {
    const char *between = "";
    printf("  \"plausible\": {");
    for (size_t i = 0; i < schema_bound_rows; i++)
        if (schema_bounds[i].kind == BOUND_LIMIT) {
            printf("%s\n    \"%s\": ", between, schema_bounds[i].name);
            print_number(schema_bounds[i].most);
            between = ",";
        }
    printf("\n  },\n");
}

void schema_print_json(void) {
    printf("{\n  \"about\": \"Printed by tools/schema; see tests/layering/schema.py.\",\n");
    print_limit_table();
    print_bounds();
    print_messages();
    print_settings();
    print_all_words("enums", schema_enums, schema_enum_rows, ",");
    print_all_words("words", schema_words, schema_word_rows, "");
    printf("}\n");
}
