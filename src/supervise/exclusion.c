// SPDX-License-Identifier: MIT
#include "supervise/exclusion.h"

#include "limits/limits.h"

plr_misfit plr_exclusion_misfit(uint64_t left_out, const plr_exclusion_evidence *all,
                                plr_real nu2) {
    if (all->misfits < plr_limit_count(left_out, PLR_LIMIT_FEW))
        return PLR_MISFIT_NONE;
    if (all->weight < plr_limit(left_out, PLR_LIMIT_MISFIT_WEIGHT) * all->parts ||
        nu2 > plr_limit(left_out, PLR_LIMIT_MISFIT_NU))
        return PLR_MISFIT_MANY;
    return PLR_R(2) * all->told_by_misfits > all->told ? PLR_MISFIT_FEW : PLR_MISFIT_NONE;
}

bool plr_exclusion_has_support(uint64_t left_out, const plr_exclusion_evidence *all,
                               plr_misfit misfit) {
    const bool enough = misfit == PLR_MISFIT_MANY ? 5 * all->against >= all->active
                                                  : PLR_R(2) * all->told_against > all->told;
    const bool few = all->active < plr_limit_count(left_out, PLR_LIMIT_ALL_BELOW);
    return all->against >= plr_limit_count(left_out, PLR_LIMIT_FEW) && enough &&
           4 * all->with <= all->against &&
           (few ? all->agree == all->points : plr_exclusion_most_agree(all));
}

bool plr_exclusion_is_well_spread(uint64_t left_out, plr_real unobserved) {
    return !(unobserved > plr_limit(left_out, PLR_LIMIT_WELL_SPREAD));
}
