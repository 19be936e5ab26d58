// SPDX-License-Identifier: MIT
#include "supervise/doubt.h"

/* The arrows of the drawing in docs/SUPERVISION.md. */
static const struct {
    uint8_t from, event, to;
} arrows[] = {
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
    for (unsigned i = 0; i < sizeof arrows / sizeof arrows[0]; i++)
        if (arrows[i].from == s->doubt && arrows[i].event == event) {
            s->doubt = arrows[i].to;
            return;
        }
}
