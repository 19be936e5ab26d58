// SPDX-License-Identifier: MIT
/* Whether this processor has the instructions that the library was built for. It is built for any
 * processor of the family, so that it can be asked before the library is called. */
#ifndef PELORUS_POSIX_PROCESSOR_H
#define PELORUS_POSIX_PROCESSOR_H

/* The name of one that is missing; NULL: none. */
const char *processor_lacks(void);

#endif
