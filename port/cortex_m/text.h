// SPDX-License-Identifier: MIT
/* Builds short messages in a fixed buffer; what does not fit is cut. There is no printf here. */
#ifndef PELORUS_CORTEX_M_TEXT_H
#define PELORUS_CORTEX_M_TEXT_H

#include <stddef.h>
#include <stdint.h>

typedef struct text {
    char characters[160]; /* closed by zero */
    size_t length;
} text;

void text_clear(text *t);
void text_add(text *t, const char *words);
void text_add_number(text *t, uint64_t number);
void text_add_hex(text *t, uint32_t number);                     /* as 0x and eight digits */
void text_add_field(text *t, const char *name, uint64_t number); /* "name number " */

/* Ends the line, writes it to the link and clears it. */
void text_put_line(text *t);

#endif
