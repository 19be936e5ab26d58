// SPDX-License-Identifier: MIT
/* Builds the line of a TEXT, without stdio; if too long it is cut after a whole character. */
#ifndef PLR_SESSION_LINE_H
#define PLR_SESSION_LINE_H

#include "pelorus/wire.h"

/* The line holds these words alone. */
void plr_line_begin(plr_text *line, plr_severity severity, const char *words);

void plr_line_text(plr_text *line, const char *added);

/* Adds a text, then a whole number. */
void plr_line_count(plr_text *line, const char *before, uint64_t number);

/* Adds a number as %g would: six significant digits, with an exponent outside 1e-4 to 1e6. */
void plr_line_number(plr_text *line, double number);

/* Adds seconds with three decimals: "12.345 s". */
void plr_line_time(plr_text *line, plr_time_ns t_ns);

#endif
