// SPDX-License-Identifier: MIT
#ifndef PELORUS_CORTEX_M_PANIC_H
#define PELORUS_CORTEX_M_PANIC_H

/* Sends a TEXT frame of severity error over the link, by polling: for fault handlers. */
void panic_text(const char *words);

#endif
