// SPDX-License-Identifier: MIT
/* Does this processor have what the library was built for? Everything in this folder is built for
 * the family's baseline, so that the question can be asked before the library is called. */
#ifndef PELORUS_POSIX_CPU_H
#define PELORUS_POSIX_CPU_H

/* The name of a missing feature, or NULL. */
const char *cpu_lacks(void);

#endif
