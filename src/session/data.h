// SPDX-License-Identifier: MIT
/* TWIST, STEREO, TRUTH, READING, and START among them: s->in is one of them. */
#ifndef PLR_SESSION_DATA_H
#define PLR_SESSION_DATA_H

#include "pelorus/session.h"

/* With a filter that runs. */
void plr_data_use_twist(plr_session *s);
void plr_data_use_stereo(plr_session *s);
void plr_data_use_truth(plr_session *s);
void plr_data_use_reading(plr_session *s);

/* Sets the pose anew. */
void plr_data_use_start(plr_session *s);

/* Lowers the budget of a STEREO to what the deadline allows. */
void plr_data_limit_frame(plr_session *s);

/* Refuses a STEREO. */
void plr_data_refuse_frame(plr_session *s, plr_status status);

/* Applies the twists that are held back, of times up to until_ns. */
void plr_data_apply_held(plr_session *s, plr_time_ns until_ns);

#endif
