// SPDX-License-Identifier: MIT
#include "support/state_places.h"

#include <string.h>
#include <unity.h>

#include "pelorus/filter.h"

enum { U8 = 1, U16 = 2, U32 = 4, U64 = 8, F64 = 8, REAL = sizeof(plr_real) }; /* bytes */

typedef struct row {
    const char *table; /* begins here; NULL: a field */
    const char *field;
    uint32_t bytes;
} row;

#define TABLE(name, times) {.table = #name},
#define GROUP(about)
#define FIELD(type, member, kind, count, most, about) {.field = #member, .bytes = (count) * (kind)},
#define END(name)                                     {.field = "end"},
static const row rows[] = {
#include "filter/snapshot.def"
};

uint32_t state_place(const char *table, const char *field) {
    const char *in = "";
    uint32_t at = 0, begin = 0;
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        if (rows[i].table) {
            if (strcmp(in, "setting") == 0)
                at += (plr_setting_count() - 1) * (at - begin);
            in = rows[i].table;
            begin = at;
        } else if (strcmp(in, table) == 0 && strcmp(rows[i].field, field) == 0)
            return at;
        at += rows[i].bytes;
    }
    TEST_FAIL_MESSAGE(field);
    return 0;
}

uint32_t state_place_of_landmark(unsigned number, const char *field) {
    const uint32_t bytes = state_place("slot", "end") - state_place("slot", "x");
    return state_place("slot", field) + number * bytes;
}
