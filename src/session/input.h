// SPDX-License-Identifier: MIT
/* What a session does with each kind of message in each phase: the table is in input.c. */
#ifndef PLR_SESSION_INPUT_H
#define PLR_SESSION_INPUT_H

#include "pelorus/session.h"

/* Handles s->in as the table says. After an END plr_session_finish does the rest. */
void plr_input_handle(plr_session *s);

#endif
