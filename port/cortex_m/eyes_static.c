// SPDX-License-Identifier: MIT
/* Where a board has two memories, its linker script places these by name: a camera's DMA writes pictures, and must
 * reach them; eyes are the processor's alone. */
#include "eyes.h"

static uint8_t pictures[2][PLR_VISION_PIXELS]
    __attribute__((aligned(32), section(".bss.pictures")));
static plr_eyes eyes __attribute__((section(".bss.eyes")));

plr_eyes *firmware_eyes(void) {
    return plr_eyes_init(&eyes, pictures[0], pictures[1], PLR_VISION_PIXELS) == PLR_OK ? &eyes : 0;
}
