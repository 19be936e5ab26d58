// SPDX-License-Identifier: MIT
/* What a session does with each kind of message. */
#ifndef PLR_SESSION_INPUTS_H
#define PLR_SESSION_INPUTS_H

#include "pelorus/session.h"

/* Handles s->in, whatever it is. True if it was END. */
bool plr_take_message(plr_session *s);

/* What comes before the data: inputs_setup.c. */
void plr_take_header(plr_session *s);
void plr_take_config(plr_session *s);
void plr_take_start(plr_session *s);
void plr_take_landmark(plr_session *s);
void plr_take_text(plr_session *s);

/* saving.c */
void plr_take_state(plr_session *s);

/* The data: inputs_data.c. */
void plr_take_twist(plr_session *s);
void plr_take_stereo(plr_session *s);
void plr_take_truth(plr_session *s);

/* Applies the twists that are held back. */
void plr_take_all_held(plr_session *s);

#endif
