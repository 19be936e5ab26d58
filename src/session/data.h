// SPDX-License-Identifier: MIT
/* What happens to STEREO, TRUTH and a START among the data. The message is in s->in. */
#ifndef PLR_SESSION_DATA_H
#define PLR_SESSION_DATA_H

#include "pelorus/session.h"

/* Each applies its message to the filter, which must be initialised.
 *
 * With twist-delay, or if camera-offset moves it ahead, a STEREO beyond the last step waits until
 * the steps up to its time are there, until another STEREO is newer by twist-delay and what
 * camera-offset moves it, or until the room for those that wait is taken (totals.held_short). Only
 * messages tell the time, so that a replay does the same. */
void plr_data_use_stereo(plr_session *s);
void plr_data_use_truth(plr_session *s);

/* Uses the STEREOs that wait, of the steps' time until_ns at most, and the steps that wait too. */
void plr_data_use_waiting(plr_session *s, plr_time_ns until_ns);

/* Sets the filter's pose to that of a START. */
void plr_data_use_start(plr_session *s);

/* Lowers the budget of a STEREO to what can be computed before the deadline. */
void plr_data_limit_frame(plr_session *s);

/* Answers a STEREO that is refused. */
void plr_data_refuse_frame(plr_session *s, const plr_frame *frame, plr_status status);

#endif
