// SPDX-License-Identifier: MIT
#include "supervise/doubt.h"

#include "math/arrows.h"

/* The arrows of the drawing in docs/SUPERVISION.md. */
static const plr_arrow arrows[] = {
    {PLR_DOUBT_NONE, PLR_DOUBT_CONTRADICTS, PLR_DOUBT_CONTRADICTED},
    {PLR_DOUBT_NONE, PLR_DOUBT_DEPARTS, PLR_DOUBT_DEPARTED},
    {PLR_DOUBT_NONE, PLR_DOUBT_LOSES, PLR_DOUBT_SETTLING},
    {PLR_DOUBT_DEPARTED, PLR_DOUBT_CONTRADICTS, PLR_DOUBT_CONTRADICTED},
    {PLR_DOUBT_DEPARTED, PLR_DOUBT_RETURNS, PLR_DOUBT_SETTLING},
    {PLR_DOUBT_CONTRADICTED, PLR_DOUBT_SETTLES, PLR_DOUBT_NONE},
    {PLR_DOUBT_SETTLING, PLR_DOUBT_CONTRADICTS, PLR_DOUBT_CONTRADICTED},
    {PLR_DOUBT_SETTLING, PLR_DOUBT_DEPARTS, PLR_DOUBT_DEPARTED},
    {PLR_DOUBT_SETTLING, PLR_DOUBT_SETTLES, PLR_DOUBT_NONE},
};

void plr_doubt_change(plr_supervisor *s, plr_doubt_event event) {
    s->doubt = (uint8_t)plr_arrow_follow(arrows, sizeof arrows / sizeof *arrows, s->doubt, event);
}
