// SPDX-License-Identifier: MIT
/* Work in pieces on several processes. A process that dies takes its own piece with it, no other. */
#ifndef CAMPAIGN_POOL_H
#define CAMPAIGN_POOL_H

#include <stddef.h>

/* Memory that all processes share; ends the program with a message if there is none. */
void *pool_shared(size_t bytes);

/* Does piece `index` of the work; what it finds out goes to memory of pool_shared. */
typedef void (*pool_work)(void *context, unsigned index);

/* Does pieces 0 to n - 1 on so many processes; one that has done `batch` pieces makes place for a
 * fresh one (0: never). Progress on stderr: "so many of n `what`". */
void pool_run(unsigned n, unsigned jobs, unsigned batch, const char *what, pool_work work,
              void *context);

/* Processors that are there. */
unsigned pool_processors(void);

#endif
