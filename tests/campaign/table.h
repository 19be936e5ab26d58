// SPDX-License-Identifier: MIT
/* What the outcomes of a scenario come to: its lines of the printed table, and its verdict. */
#ifndef CAMPAIGN_TABLE_H
#define CAMPAIGN_TABLE_H

#include <stdbool.h>

#include "campaign/drive.h"

void table_heading(void);

/* True if the scenario meets every limit that it has. */
bool table_print(const scenario *s, const outcome *outcomes, unsigned seeds);

/* The same by the policy that it is not judged by, below. */
void table_print_other(const scenario *s, uint8_t scene, const outcome *outcomes, unsigned seeds);

#endif
