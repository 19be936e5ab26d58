// SPDX-License-Identifier: MIT
#include "posix/pictures.h"

static uint8_t left[PLR_VISION_PIXELS], right[PLR_VISION_PIXELS];
static plr_eyes eyes;

plr_eyes *pictures_eyes(void) {
    return plr_eyes_init(&eyes, left, right, PLR_VISION_PIXELS) == PLR_OK ? &eyes : NULL;
}
