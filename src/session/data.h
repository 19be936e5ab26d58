// SPDX-License-Identifier: MIT
/* What happens to STEREO, TRUTH and a START among the data. The message is in s->in. */
#ifndef PLR_SESSION_DATA_H
#define PLR_SESSION_DATA_H

#include "pelorus/session.h"

/* Each applies its message to the filter, which must be initialised. A STEREO that the setting
 * camera-offset moves beyond the last step waits for those up to its time. */
void plr_data_use_stereo(plr_session *s);
void plr_data_use_truth(plr_session *s);

/* Uses the STEREO that waits, if there is one, and the steps that waited with it. */
void plr_data_use_waiting(plr_session *s);

/* Does so if the steps have come to its time. */
void plr_data_use_waiting_in_time(plr_session *s);

/* Sets the filter's pose to that of a START. */
void plr_data_use_start(plr_session *s);

/* Lowers the budget of a STEREO, the number of observations that may be used, to what can be
 * computed before the deadline. */
void plr_data_limit_frame(plr_session *s);

/* Answers a STEREO that is refused. */
void plr_data_refuse_frame(plr_session *s, const plr_frame *frame, plr_status status);

#endif
