// SPDX-License-Identifier: MIT
/* All else is in drivers/mps2.c. */
#include "../../board.h"

const char board_name[] = "mps2_an500";
