// SPDX-License-Identifier: MIT
#include "eyes.h"

plr_eyes *firmware_eyes(void) {
    return 0;
}
