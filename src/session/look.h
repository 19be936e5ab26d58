// SPDX-License-Identifier: MIT
/*
 * Pictures: IMAGEs become pairs, pairs become frames (eyes.h), and a frame goes on as a STEREO does: a log has it
 * as one. What is wrong with pictures is refused with a REPORT of subject IMAGE, and said once in a drive.
 */
#ifndef PLR_SESSION_LOOK_H
#define PLR_SESSION_LOOK_H

#include "pelorus/eyes.h"
#include "pelorus/session.h"

/* RIG and IMAGE, in s->in. */
void plr_look_take_rig(plr_session *s);
void plr_look_take(plr_session *s);

/* A pair. PLR_OK, or why it was refused; that is answered already. */
plr_status plr_look_at(plr_session *s, const plr_picture_pair *pair);

#endif
