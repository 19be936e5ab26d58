// SPDX-License-Identifier: MIT
/* The number of an option. */
#ifndef CAMPAIGN_WHOLE_NUMBER_H
#define CAMPAIGN_WHOLE_NUMBER_H

#include <errno.h>
#include <stdlib.h>

/* Returns the number that the text is, 1 to `most`; 0 if it is none, or NULL. */
static inline unsigned long whole_number(const char *text, unsigned long most) {
    char *end = NULL;
    errno = 0;
    const unsigned long n = text ? strtoul(text, &end, 10) : 0;
    return !text || end == text || *end || errno || text[0] == '-' || n > most ? 0 : n;
}

#endif
