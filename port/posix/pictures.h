// SPDX-License-Identifier: MIT
/* The eyes of the replay; chosen by file, as a build may be without src/vision. */
#ifndef PELORUS_POSIX_PICTURES_H
#define PELORUS_POSIX_PICTURES_H

#include "pelorus/eyes.h"

/* Eyes with room for a build's largest pictures, or NULL where there are none. One for a program. */
plr_eyes *pictures_eyes(void);

#endif
