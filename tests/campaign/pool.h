// SPDX-License-Identifier: MIT
/* Runs (scenario, seed) pairs on several processes. A process that dies takes its own pair with it
 * and no other. */
#ifndef CAMPAIGN_POOL_H
#define CAMPAIGN_POOL_H

#include <stddef.h>
#include <stdint.h>

#include "campaign/drive.h"

typedef struct task {
    const scenario *s;
    uint64_t seed;
} task;

/* Memory that all processes share; ends the program with a message if there is none. */
void *pool_shared(size_t bytes);

/* outcomes, of pool_shared, is filled: one for each task. Progress on stderr. */
void pool_run(const task *tasks, unsigned n, unsigned jobs, unsigned parked_frames,
              outcome *outcomes);

/* Processors that are there. */
unsigned pool_processors(void);

#endif
