// SPDX-License-Identifier: MIT
/*
 * Handles processor faults: sends a TEXT frame of severity error over the link, by polling, that
 * says what happened and where; then resets the board. The description survives the reset, for the
 * boot message.
 */
#ifndef PELORUS_CORTEX_M_FAULT_H
#define PELORUS_CORTEX_M_FAULT_H

#include <stdint.h>

#include "text.h"

/* Adds to a message why the board started: "power-on", or the last fault, and how many there were
 * since power-on. */
void fault_add_history(text *t);

/* Faults since power-on. */
uint32_t fault_count(void);

#endif
