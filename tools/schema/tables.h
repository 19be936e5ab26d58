// SPDX-License-Identifier: MIT
/* The tables of the library with their words, which the library itself leaves out. */
#ifndef PELORUS_SCHEMA_TABLES_H
#define PELORUS_SCHEMA_TABLES_H

#include <stddef.h>

typedef enum row_kind {
    ROW_TABLE, /* a message or a table of the state begins */
    ROW_GROUP,
    ROW_FIELD,
    ROW_REPEATED, /* the fields behind it are those of a row, which is repeated */
    ROW_COLUMNS,  /* those behind it were added to the rows later, and stand behind all of them */
    ROW_END
} row_kind;

/* One line of messages.def or snapshot.def. */
typedef struct row {
    row_kind kind;
    const char *name;
    unsigned number; /* of a message */
    const char *from;
    const char *type; /* plr_field_kind without its prefix */
    unsigned count, least, most, since;
    const char *unit, *about;
} row;

typedef enum bound_kind { BOUND_LIMIT, BOUND_GROUP, BOUND_NUMBERS } bound_kind;

/* One line of session/limits.def. */
typedef struct bound {
    bound_kind kind;
    const char *name; /* of the limit or the group; of numbers that of their limit */
    double most;
    unsigned count;
    const char *text; /* what is limited or refused; of numbers the member */
    const char *unit; /* of numbers the flag, "" where there is none */
} bound;

/* A line of words.def, or a name of an enum. */
typedef struct word {
    const char *of, *name;
    int number;
    const char *text;
} word;

typedef struct limit {
    const char *name;
    double value;
} limit;

extern const row schema_messages[], schema_state[], schema_slot[];
extern const bound schema_bounds[];
extern const word schema_words[], schema_enums[];
extern const limit schema_limits[];
extern const size_t schema_message_rows, schema_state_rows, schema_slot_rows, schema_bound_rows,
    schema_word_rows, schema_enum_rows, schema_limit_rows;

#endif
