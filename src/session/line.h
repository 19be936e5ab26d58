// SPDX-License-Identifier: MIT
/* One line of text in a fixed buffer, without stdio. What does not fit is cut, at the end of a
 * whole character. */
#ifndef PLR_SESSION_LINE_H
#define PLR_SESSION_LINE_H

#include "pelorus/wire.h"

/* Empties it. */
void plr_line_begin(plr_text *line, plr_severity severity);

void plr_line_text(plr_text *line, const char *added);

/* A whole number, and the text before it. */
void plr_line_count(plr_text *line, const char *before, uint64_t number);

/* Six significant digits at most, like printf's %g, with an exponent outside 1e-4 to 1e6. */
void plr_line_number(plr_text *line, double number);

/* Seconds with three decimals: "12.345 s". */
void plr_line_time(plr_text *line, plr_time_ns t_ns);

#endif
