// SPDX-License-Identifier: MIT
/* What a frame does. Frames come in the order of time (events.h). */
#ifndef PLR_SESSION_FRAMES_H
#define PLR_SESSION_FRAMES_H

#include "pelorus/session.h"

/* Gives the filter an event that is a frame, and answers it. */
void plr_frames_use(plr_session *s, const plr_event *event);

/* Answers a frame that is refused. */
void plr_frames_refuse(plr_session *s, const plr_frame *frame, plr_status status);

/* Lowers the budget of the STEREO in s->in to what can be computed before the deadline. */
void plr_frames_limit(plr_session *s);

#endif
