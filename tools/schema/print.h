// SPDX-License-Identifier: MIT
/* The two forms in which the tables are printed to stdout. */
#ifndef PELORUS_SCHEMA_PRINT_H
#define PELORUS_SCHEMA_PRINT_H

#include <stdbool.h>

#include "schema/tables.h"

/* json.c */
void schema_print_json(void);

/* markdown.c: false if there is no such table. */
bool schema_print_markdown(const char *table);

/* outside.c: a field's type as bytes, "u8" to "f64", "real" for 4 or 8 bytes, "text"; and the bytes of
 * one number, 0 where that is not fixed. */
const char *schema_type(const row *field);
unsigned schema_bytes(const row *field);

/* The name of an enumerator without its prefix: ARGUMENT of PLR_E_ARGUMENT. */
const char *schema_short_name(const word *w);

#endif
