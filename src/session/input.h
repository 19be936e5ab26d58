// SPDX-License-Identifier: MIT
/* What a session does with each kind of message in each phase: the table is in input.c. */
#ifndef PLR_SESSION_INPUT_H
#define PLR_SESSION_INPUT_H

#include "pelorus/session.h"

/* Does with s->in what the table says. What END does besides is plr_session_finish's. */
void plr_input_handle(plr_session *s);

#endif
