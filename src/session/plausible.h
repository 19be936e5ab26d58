// SPDX-License-Identifier: MIT
/* Finds numbers that no sensor measures, by the table of limits.def. */
#ifndef PLR_SESSION_PLAUSIBLE_H
#define PLR_SESSION_PLAUSIBLE_H

#include "pelorus/wire.h"

/* Numbers that are checked together: the groups of limits.def, with the structs that it names. */
#define LIMIT(name, most, what, unit)
#define GROUP(name, type, what) PLR_GROUP_##name,
#define BOUND(group, type, member, count, limit)
#define BOUND_IF(group, type, member, count, limit, flag)
typedef enum plr_group {
    PLR_GROUP_NONE, /* nothing */
#include "session/limits.def"
} plr_group;
#undef LIMIT
#undef GROUP
#undef BOUND
#undef BOUND_IF

/* True if all numbers of the group are within their limits; `object` is of the group's struct. */
bool plr_plausible(plr_group group, const void *object);

/* The same of a message as a whole: TWIST, START, LANDMARK, READING. Of other kinds true. */
bool plr_plausible_message(const plr_message *message);

#endif
