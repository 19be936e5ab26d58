// SPDX-License-Identifier: MIT
#include <stdio.h>
#include <string.h>

#include "pelorus/settings.h"
#include "pelorus/supervisor.h"
#include "schema/print.h"

static bool is(const row *field, const char *type) {
    return strcmp(field->type, type) == 0;
}

/* --- where a field stands --- */

/* Bytes before it: a fixed number, reals, and a text whose length comes before. */
typedef struct place {
    unsigned bytes, reals;
    const char *text; /* its name, or NULL */
    const char *rows; /* what follows as often as a number says */
} place;

static void print_place(const place *at) {
    printf("%u", at->bytes);
    if (at->reals > 0)
        printf(" + %u r", at->reals);
    if (at->text)
        printf(" + %s", at->text);
    if (at->rows)
        printf(" + %s", at->rows);
}

static unsigned numbers(const row *field) {
    return is(field, "BITS") ? 1 : field->count;
}

static void step_over(place *at, const row *field) {
    if (strcmp(schema_type(field), "real") == 0)
        at->reals += field->count;
    else if (schema_bytes(field) == 0)
        at->text = field->name;
    else
        at->bytes += numbers(field) * schema_bytes(field);
}

/* Bytes of one row of a message that has rows, or of the columns behind them. */
static unsigned row_bytes(const row *repeated) {
    unsigned bytes = 0;
    for (const row *r = repeated + 1; r->kind == ROW_FIELD; r++)
        bytes += schema_bytes(r);
    return bytes;
}

/* --- messages --- */

static const row *message_of(const char *name) {
    for (size_t i = 0; i < schema_message_rows; i++)
        if (schema_messages[i].kind == ROW_TABLE && strcmp(schema_messages[i].name, name) == 0)
            return &schema_messages[i];
    return NULL;
}

static void print_type(const row *field) {
    printf("%s", schema_type(field));
    if (numbers(field) > 1)
        printf("[%u]", numbers(field));
}

static void print_field(const place *at, const row *field) {
    printf("| ");
    print_place(at);
    printf(" | ");
    print_type(field);
    printf(" | %s | %s | ", is(field, "SPARE") ? "" : field->name, field->unit);
    printf("%s", field->about);
    if (field->since > 0)
        printf("%ssince 1.%u", field->about[0] ? "; " : "", field->since);
    printf(" |\n");
}

static void print_message(const row *message) {
    place at = {0, 0, NULL, NULL};
    unsigned before = 0, each = 0; /* bytes before the rows, and of a row */
    char rows[48];
    printf("| at | type | field | unit | |\n|---|---|---|---|---|\n");
    for (const row *r = message + 1; r->kind != ROW_END; r++) {
        if (r->kind == ROW_REPEATED) {
            before = at.bytes;
            each = row_bytes(r);
            snprintf(rows, sizeof rows, "%u i", each);
            at.rows = rows;
            continue;
        }
        if (r->kind == ROW_COLUMNS) {
            at.bytes = before;
            snprintf(rows, sizeof rows, "%u n + %u i", each, row_bytes(r));
            continue;
        }
        print_field(&at, r);
        step_over(&at, r);
    }
}

static void print_kinds(void) {
    printf("| kind | name | payload bytes | from | |\n|---|---|---|---|---|\n");
    for (size_t i = 0; i < schema_message_rows; i++) {
        const row *r = &schema_messages[i];
        place at = {0, 0, NULL, NULL};
        char rows[48];
        if (r->kind != ROW_TABLE)
            continue;
        printf("| %u | %s | ", r->number, r->name);
        const char *from = r->from, *about = r->about;
        for (r++; r->kind == ROW_FIELD; r++)
            step_over(&at, r);
        if (r->kind == ROW_REPEATED) {
            const unsigned each = row_bytes(r);
            for (r++; r->kind == ROW_FIELD;)
                r++;
            if (r->kind == ROW_COLUMNS)
                snprintf(rows, sizeof rows, "%u n, or %u n", each, each + row_bytes(r));
            else
                snprintf(rows, sizeof rows, "%u n", each);
            at.rows = rows;
        }
        print_place(&at);
        printf(" | %s | %s |\n", from, about);
    }
}

/* --- settings, words --- */

static void print_values(const plr_setting *s) {
    for (unsigned i = 0; s->choices && s->choices[i]; i++)
        printf("%s%u %s", i > 0 ? ", " : "", s->kind == PLR_SETTING_LIST ? 1U << i : i,
               s->choices[i]);
    if (s->kind == PLR_SETTING_COUNT)
        printf("1 to the build's capacity");
    else if (!s->choices)
        printf("%g to %g", s->minimum, s->maximum);
}

static void print_standard(const plr_setting *s) {
    if (s->kind == PLR_SETTING_COUNT)
        printf("100, or the capacity");
    else if (s->kind == PLR_SETTING_LIST)
        printf("%s", s->standard > 0 ? "all" : "off");
    else if (s->choices)
        printf("%s", s->choices[(unsigned)s->standard]);
    else
        printf("%g", s->standard);
}

static void print_settings(void) {
    printf("| id | name | unit | values | default | |\n|---|---|---|---|---|---|\n");
    for (unsigned i = 0; i < plr_setting_count(); i++) {
        const plr_setting *s = plr_setting_at(i);
        printf("| %u | %s | %s | ", (unsigned)s->id, s->name, s->unit);
        print_values(s);
        printf(" | ");
        print_standard(s);
        printf(" | %s |\n", plr_setting_about(s));
    }
}

static unsigned bit_of(unsigned reason) {
    unsigned bit = 0;
    while (reason >> bit > 1)
        bit++;
    return bit;
}

static void print_words(const char *of, const char *title, const word *words, size_t n) {
    printf("| %s | name | |\n|---|---|---|\n", title);
    for (size_t i = 0; i < n; i++) {
        const word *w = &words[i];
        if (strcmp(w->of, of) != 0)
            continue;
        if (strcmp(of, "reason") == 0)
            printf("| %u", bit_of((unsigned)w->number));
        else
            printf("| %d", w->number);
        printf(" | %s | %s |\n", schema_short_name(w), w->text);
    }
}

/* --- the saved state --- */

static void print_state(void) {
    const char *group = "", *times = "";
    printf("| | | | |\n|---|---|---|---|\n");
    for (size_t i = 0; i < schema_state_rows; i++) {
        const row *r = &schema_state[i];
        if (r->kind == ROW_TABLE)
            times = r->from;
        if (r->kind == ROW_GROUP)
            group = r->about;
        if (r->kind != ROW_FIELD)
            continue;
        printf("| ");
        if (group[0])
            printf("**%s**%s", group, times[0] ? ", " : "");
        printf("%s | ", times);
        print_type(r);
        printf(" | %s | %s |\n", r->name, r->about);
        group = times = "";
    }
}

static void print_slot(void) {
    place at = {0, 0, NULL, NULL};
    printf("| at | type | field | unit | |\n|---|---|---|---|---|\n");
    for (size_t i = 0; i < schema_slot_rows; i++) {
        print_field(&at, &schema_slot[i]);
        step_over(&at, &schema_slot[i]);
    }
}

/* --- numbers that no sensor measures --- */

static const bound *limit_of(const bound *numbers) {
    const bound *b = schema_bounds;
    while (b->kind != BOUND_LIMIT || strcmp(b->name, numbers->name) != 0)
        b++;
    return b;
}

static void print_bounds(void) {
    const char *what = "";
    printf("| refused is | for | beyond | |\n|---|---|---|---|\n");
    for (size_t i = 0; i < schema_bound_rows; i++) {
        const bound *b = &schema_bounds[i];
        if (b->kind == BOUND_GROUP)
            what = b->text;
        if (b->kind != BOUND_NUMBERS)
            continue;
        const bound *due = limit_of(b);
        printf("| %s | `%s`", what, b->text);
        if (b->unit[0])
            printf(", where `%s`", b->unit);
        printf(" | %g %s | %s |\n", due->most, due->unit, due->text);
        what = "";
    }
}

static void print_limit(const plr_limit_row *l) {
    printf("| %s | %g | %s | %s | %s | %s |\n", l->name, l->value, l->unit, l->about, l->scenario,
           l->recording);
}

/* Each rule, and the numbers that belong to it. */
static void print_limits(void) {
    printf("| threshold | | unit | what, and why | needed on | and on the recording |\n"
           "|---|---|---|---|---|---|\n");
    for (unsigned i = 0; i < PLR_RULES; i++) {
        print_limit(plr_limit_at(i));
        for (unsigned k = PLR_RULES; k < PLR_LIMITS; k++)
            if (strcmp(plr_limit_at(k)->rule, plr_limit_at(i)->name) == 0)
                print_limit(plr_limit_at(k));
    }
}

bool schema_print_markdown(const char *table) {
    const row *message = message_of(table);
    if (message)
        print_message(message);
    else if (strcmp(table, "kinds") == 0)
        print_kinds();
    else if (strcmp(table, "settings") == 0)
        print_settings();
    else if (strcmp(table, "statuses") == 0)
        print_words("status", "status", schema_words, schema_word_rows);
    else if (strcmp(table, "reasons") == 0)
        print_words("reason", "bit", schema_words, schema_word_rows);
    else if (strcmp(table, "imu_faults") == 0)
        print_words("imu_fault", "fault", schema_words, schema_word_rows);
    else if (strcmp(table, "sensors") == 0)
        print_words("sensor", "sensor", schema_enums, schema_enum_rows);
    else if (strcmp(table, "state") == 0)
        print_state();
    else if (strcmp(table, "slot") == 0)
        print_slot();
    else if (strcmp(table, "bounds") == 0)
        print_bounds();
    else if (strcmp(table, "limits") == 0)
        print_limits();
    else
        return false;
    return true;
}
