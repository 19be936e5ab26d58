// SPDX-License-Identifier: MIT
/* Registers: data sheet MT9V034/D, tables of context A. */
#include "mt9v034.h"

enum {
    VERSION = 0x00,
    VERSION_MT9V034 = 0x1324,
    EXPOSURE = 0x0B, /* coarse shutter width, rows */
    PATTERN = 0x7F,
    PATTERN_DIAGONAL = 1 << 13 | 3 << 11
};

static const struct {
    uint8_t where;
    uint16_t value;
} settings[] = {
    {0x01, 1},
    {0x02, 4}, /* the window's first column and row, */
    {0x03, 480},
    {0x04, 752}, /* its rows and columns */
    {0x05, 94},
    {0x06, 45},     /* and what is blank behind them: a row takes 846 clocks */
    {0x0D, 0x0305}, /* rows and columns by twos */
    {0x13, 0x2D2E},
    {0x20, 0x03C7}, /* what the data sheet recommends for reserved ones */
    {0x24, 0x001B},
    {0x2B, 0x0003},
    {0x2F, 0x0003},
    {0x35, 32}, /* gain: twice */
    {0x72, 0},  /* clock and valid lines as they are: data changes as the clock rises */
    {0xAF, 0},  /* neither exposure nor gain by itself: both sensors must do the same */
    {0x07, 1 << 8 | 1 << 7 | 3 << 3}, /* parallel output; snapshots by the pin EXPOSURE */
};

bool mt9v034_start(uint8_t device, bool pattern, uint16_t rows, mt9v034_write write,
                   mt9v034_read read) {
    uint16_t version = 0;
    if (!read(device, VERSION, &version) || version != VERSION_MT9V034) {
        return false;
    }
    for (unsigned i = 0; i < sizeof settings / sizeof settings[0]; ++i) {
        if (!write(device, settings[i].where, settings[i].value)) {
            return false;
        }
    }
    return mt9v034_expose(device, rows, write) &&
           write(device, PATTERN, pattern ? PATTERN_DIAGONAL : 0);
}

bool mt9v034_expose(uint8_t device, uint16_t rows, mt9v034_write write) {
    return write(device, EXPOSURE, rows);
}
