// SPDX-License-Identifier: MIT
#include "filter/dissent.h"

#include "filter/consistency.h"
#include "filter/tracks.h"
#include "math/small.h"

enum { MIN_POINTS = 6 }; /* fewer say little about each other */

/* Points at rest scatter about their common motion by 1 a point, those of wheels that slip by up to
 * 1.5. */
#define SCATTER_ABOVE PLR_R(2.5)

void plr_dissent_begin(const plr_filter *f, plr_dissent *d) {
    const plr_dissent none = {0};
    *d = none;
    d->asked = plr_consistency_difference(f, d->n);
}

void plr_dissent_add(plr_dissent *d, const plr_slot *slot,
                     const plr_real a[PLR_ROWS * PLR_POSE_DIM], const plr_real M[6]) {
    const plr_real v = slot->innovation_variance;
    plr_real c[PLR_ROWS] = {0};
    if (!d->asked || !(v > 0))
        return;
    for (unsigned r = 0; r < PLR_ROWS; r++)
        for (unsigned k = 0; k < PLR_POSE_DIM; k++)
            c[r] = PLR_FMA(a[PLR_POSE_DIM * r + k], d->n[k], c[r]);
    plr_solve3_transposed(1, M, c);
    const plr_real c2 = plr_dot3(c, c);
    if (!(c2 > 0))
        return;
    const plr_real m = plr_dot3(slot->innovation_sum, c) / PLR_SQRT(c2 * v);
    const plr_real g = plr_track_share(slot) * PLR_SQRT(c2 / v);
    d->mm = PLR_FMA(m, m, d->mm);
    d->mg = PLR_FMA(m, g, d->mg);
    d->gg = PLR_FMA(g, g, d->gg);
    d->points++;
}

bool plr_dissent_is_found(const plr_dissent *d) {
    if (d->points < MIN_POINTS || !(d->gg > 0))
        return false;
    const plr_real scatter = d->mm - d->mg * d->mg / d->gg;
    return scatter > SCATTER_ABOVE * (plr_real)d->points;
}
