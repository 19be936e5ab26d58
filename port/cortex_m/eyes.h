// SPDX-License-Identifier: MIT
/* The eyes of the firmware; chosen by file, as most images have none. */
#ifndef EYES_H
#define EYES_H

#include "pelorus/eyes.h"

/* Eyes with memory for a pair, or NULL. */
plr_eyes *firmware_eyes(void);

#endif
