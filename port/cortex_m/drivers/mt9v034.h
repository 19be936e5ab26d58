// SPDX-License-Identifier: MIT
/* onsemi MT9V034, 752 x 480 with a global shutter: the same settings for both of a pair. */
#ifndef PELORUS_CORTEX_M_MT9V034_H
#define PELORUS_CORTEX_M_MT9V034_H

#include <stdbool.h>
#include <stdint.h>

/* A sensor's two-wire registers, 16 bits each. False: it does not answer. */
typedef bool (*mt9v034_write)(uint8_t device, uint8_t where, uint16_t value);
typedef bool (*mt9v034_read)(uint8_t device, uint8_t where, uint16_t *value);

/* Pictures of 376 x 240 (squares of four pixels are one), each begun by a pulse at EXPOSURE, of fixed gain, exposed by
 * so many rows. With `pattern` a diagonal grey wedge in place of what it sees. False: no MT9V034 answers. */
bool mt9v034_start(uint8_t device, bool pattern, uint16_t rows, mt9v034_write write,
                   mt9v034_read read);

/* Rows of exposure, of 846 clocks. */
bool mt9v034_expose(uint8_t device, uint16_t rows, mt9v034_write write);

#endif
