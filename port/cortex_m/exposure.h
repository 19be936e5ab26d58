// SPDX-License-Identifier: MIT
/* How long the next picture is exposed. */
#ifndef PELORUS_CORTEX_M_EXPOSURE_H
#define PELORUS_CORTEX_M_EXPOSURE_H

#include <stdint.h>

/* Mean grey levels that are left alone, and the one that is aimed at. */
enum { EXPOSURE_DARKEST = 70, EXPOSURE_AIM = 95, EXPOSURE_BRIGHTEST = 130 };

/* Rows of exposure after a picture of that mean grey level: at most twice or half of before, 1 to `most`. */
static inline uint16_t exposure_next(uint16_t rows, uint32_t mean, uint16_t most) {
    uint32_t next = rows;
    if (mean < EXPOSURE_DARKEST || mean > EXPOSURE_BRIGHTEST) {
        const uint32_t up =
            mean < EXPOSURE_DARKEST && mean > 0 ? mean - 1 : 0; /* one row stays not one */
        next = (rows * (uint32_t)EXPOSURE_AIM + up) / (mean > 0 ? mean : 1);
        next = next > 2U * rows ? 2U * rows : next;
        next = next < rows / 2U ? rows / 2U : next;
    }
    next = next < 1 ? 1 : next;
    return (uint16_t)(next > most ? most : next);
}

#endif
