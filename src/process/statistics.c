// SPDX-License-Identifier: MIT
#include "process/statistics.h"

#include <string.h>

#include "math/leaky.h"
#include "math/small.h"
#include "state/seconds.h"

/* What an average keeps of a new interval, and of a new difference. */
#define INTERVAL_SHARE PLR_R(0.0625)
#define CHANGE_SHARE   PLR_R(0.015625)
/* The mean reading covers about this much at most, and no more than since the last standstill, s. */
#define SLOW_S PLR_R(0.5)

void plr_statistics_change(const plr_source *source, const plr_real reading[PLR_POSE_DIM],
                           plr_real change2[2]) {
    change2[0] = change2[1] = 0;
    for (unsigned i = 0; i < PLR_POSE_DIM; i++) {
        const plr_real off = reading[i] - source->reading[i];
        change2[i / 3] = PLR_FMA(off, off, change2[i / 3]);
    }
}

/* Each reading is compared with the line through the two before it: their second difference has six times
 * the variance of one, and a motion that goes on evenly is not in it. */
static void learn_scatter(plr_source *source, const plr_real reading[PLR_POSE_DIM],
                          plr_real interval) {
    plr_inertial *s = &source->inertial;
    const bool is_usual = interval < PLR_R(1.5) * s->usual_s;
    plr_real off2[2] = {0};
    for (unsigned i = 0; i < PLR_POSE_DIM; i++) {
        const plr_real change = (reading[i] - source->reading[i]) * (s->usual_s / interval);
        const plr_real off = change - s->change[i];
        off2[i / 3] = PLR_FMA(off, off, off2[i / 3]);
        s->change[i] = change;
    }
    for (unsigned i = 0; i < 2 && is_usual; i++)
        s->scatter2[i] = plr_leaky_mean(s->scatter2[i], CHANGE_SHARE, off2[i] / PLR_R(18));
}

void plr_statistics_learn(const plr_belief *belief, plr_source *source, plr_time_ns t_ns,
                          const plr_real reading[PLR_POSE_DIM], plr_real interval,
                          const plr_real change2[2]) {
    plr_inertial *s = &source->inertial;
    if (!source->reading_valid) {
        memcpy(s->slow, reading, sizeof s->slow);
        s->still_ns = belief->t_ns;
    }
    if (!source->reading_valid || !(interval > 0))
        return;
    if (!(s->usual_s > 0) || interval < PLR_R(0.5) * s->usual_s)
        s->usual_s = interval;
    else if (interval < PLR_R(1.5) * s->usual_s)
        s->usual_s = plr_leaky_mean(s->usual_s, INTERVAL_SHARE, interval);
    const plr_real late = interval - s->usual_s;
    s->off_usual2 = plr_leaky_mean(s->off_usual2, CHANGE_SHARE, late * late);
    for (unsigned i = 0; i < 2; i++)
        s->change2[i] = plr_leaky_mean(s->change2[i], CHANGE_SHARE, change2[i] / PLR_R(3));
    learn_scatter(source, reading, interval);
    const plr_real since = plr_seconds(t_ns - s->still_ns), span = since < SLOW_S ? since : SLOW_S;
    const plr_real share = interval < span ? interval / span : PLR_R(1);
    const plr_real slower = PLR_R(0.25) * (interval < SLOW_S ? interval / SLOW_S : PLR_R(1));
    plr_real off2[2] = {0};
    for (unsigned i = 0; i < PLR_POSE_DIM; i++) {
        const plr_real off = reading[i] - s->slow[i];
        off2[i / 3] = PLR_FMA(off, off, off2[i / 3]);
        s->slow[i] = plr_leaky_mean(s->slow[i], share, reading[i]);
    }
    for (unsigned i = 0; i < 2; i++)
        s->spread2[i] = plr_leaky_mean(s->spread2[i], slower, off2[i] / PLR_R(3));
}
