// SPDX-License-Identifier: MIT
#include "session/plausible.h"

#include "math/finite.h"

/* The greatest value of each limit. */
#define GROUP(name, type, what)
#define BOUND(group, type, member, count, limit)
#define BOUND_IF(group, type, member, count, limit, flag)
#define LIMIT(name, most, what, unit) AT_##name,
enum {
#include "session/limits.def"
    LIMITS
};
#undef LIMIT
#define LIMIT(name, most, what, unit) [AT_##name] = (most),
static const double limits[LIMITS] = {
#include "session/limits.def"
};

/* Where the numbers of a group stand in its struct. */
#undef LIMIT
#undef BOUND
#undef BOUND_IF
#define LIMIT(name, most, what, unit)
#define BOUND_AT(group_, type, member, count_, limit_, given_)                                     \
    {.offset = offsetof(type, member),                                                             \
     .given = (given_),                                                                            \
     .group = PLR_GROUP_##group_,                                                                  \
     .count = (count_),                                                                            \
     .limit = AT_##limit_},
#define BOUND(group, type, member, count, limit) BOUND_AT(group, type, member, count, limit, 0)
#define BOUND_IF(group, type, member, count, limit, flag)                                          \
    BOUND_AT(group, type, member, count, limit, offsetof(type, flag))
static const struct {
    uint16_t offset;
    uint16_t given; /* a bool; 0: in any case, since none is the first member */
    uint8_t group, count, limit;
} bounds[] = {
#include "session/limits.def"
};

static bool all_within(const double *x, unsigned n, double limit) {
    for (unsigned i = 0; i < n; i++)
        if (plr_all_finite(&x[i], 1) && (x[i] > limit || x[i] < -limit))
            return false;
    return true;
}

bool plr_plausible(plr_group group, const void *object) {
    const unsigned char *bytes = object;
    for (unsigned i = 0; i < sizeof bounds / sizeof *bounds; i++) {
        if (bounds[i].group != group)
            continue;
        if (bounds[i].given > 0 && !*(const bool *)(bytes + bounds[i].given))
            continue;
        const void *numbers = bytes + bounds[i].offset;
        if (!all_within(numbers, bounds[i].count, limits[bounds[i].limit]))
            return false;
    }
    return true;
}

bool plr_plausible_message(const plr_message *message) {
    static const uint8_t groups[PLR_WIRE_KINDS + 1] = {[PLR_KIND_TWIST] = PLR_GROUP_TWIST,
                                                       [PLR_KIND_START] = PLR_GROUP_START,
                                                       [PLR_KIND_LANDMARK] = PLR_GROUP_LANDMARK,
                                                       [PLR_KIND_READING] = PLR_GROUP_READING};
    return plr_plausible((plr_group)groups[message->kind], &message->as);
}
