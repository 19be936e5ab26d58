// SPDX-License-Identifier: MIT
/* What pelorus-replay says about itself. */
#ifndef PELORUS_POSIX_HELP_H
#define PELORUS_POSIX_HELP_H

void help_print(void);
void help_print_version(void);

#endif
