// SPDX-License-Identifier: MIT
/* The payloads of messages, by the tables of messages.def. */
#ifndef PLR_RECORD_MESSAGES_H
#define PLR_RECORD_MESSAGES_H

#include "pelorus/wire.h"
#include "record/codec.h"

/* Room for what a STEREO that is read holds. */
typedef struct plr_observation_room {
    plr_observation *observations;
    unsigned most;
} plr_observation_room;

/* Passes the payload of a kind; `content` is that member of plr_message.as, and only READ changes
 * it. A status besides those of the codec:
 * PLR_E_FOREIGN no such kind, or a HEADER of a later major version, of which only the version is
 * read; PLR_E_FULL more observations than there is room for. `room` is for READ. */
void plr_message_pass(plr_codec *c, plr_kind kind, void *content, const plr_observation_room *room);

/* The time of a message; 0 for kinds that have none. */
plr_time_ns plr_message_time(const plr_message *message);

#endif
