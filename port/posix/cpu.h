// SPDX-License-Identifier: MIT
/* Checks that this processor has the instructions that the library was built for. Everything in
 * this folder is built for any processor of the family, so that the check can run before the
 * library. */
#ifndef PELORUS_POSIX_CPU_H
#define PELORUS_POSIX_CPU_H

/* The name of a missing feature, or NULL. */
const char *cpu_lacks(void);

#endif
