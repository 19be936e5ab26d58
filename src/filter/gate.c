// SPDX-License-Identifier: MIT
#include "filter/gate.h"

#include "limits/limits.h"
#include "math/small.h"
#include "state/covariance.h"
#include "state/sensitivity.h"

plr_gate_result plr_gate_rejection(uint64_t left_out, plr_real d2) {
    return d2 > plr_limit(left_out, PLR_LIMIT_FAR_D2) ? PLR_GATE_FAR : PLR_GATE_REJECTED;
}

bool plr_gate_accepts(const plr_filter *f, bool opens, plr_real d2, plr_real residual2) {
    const bool fixed = f->par.gate_residual2 > 0;
    if (fixed && residual2 <= f->par.gate_residual2)
        return true;
    return (!fixed || opens) && plr_is_finite(d2) && (f->par.gate_d2 <= 0 || d2 <= f->par.gate_d2);
}

/* by_wheel: of errors of the wheels, too; NULL: it is no wheel's. */
static plr_verdict judge(const plr_filter *f, bool opens, const plr_measurement *m,
                         const plr_by_wheel *by_wheel) {
    plr_verdict verdict = {.accepted = false};
    plr_real full[9], S[6], e[3];
    plr_covariance_of_rows(&f->belief, &m->H, full);
    if (f->work.noise.open)
        plr_covariance_add_open_noise(&f->belief, &f->work.noise, &m->H, full);
    if (by_wheel)
        plr_sensitivity_add_to_rows(&f->belief, &f->camera, &m->H, by_wheel, full);
    for (unsigned i = 0; i < PLR_ROWS; i++) {
        if (m->max_variance > 0 && !(full[4 * i] <= m->max_variance))
            return verdict;
        full[4 * i] += m->R[i];
    }
    if (!plr_factorise3(S, full))
        return verdict;
    memcpy(e, m->r, sizeof e);
    plr_solve3_transposed(1, S, e);
    verdict.d2 = plr_dot3(e, e) + m->extra_d2;
    verdict.det_S = S[0] * S[0] * S[3] * S[3] * S[5] * S[5];
    verdict.accepted = plr_gate_accepts(f, opens, verdict.d2, m->residual2);
    return verdict;
}

plr_verdict plr_gate_judge(const plr_filter *f, bool opens, const plr_measurement *m) {
    return judge(f, opens, m, NULL);
}

plr_verdict plr_gate_judge_wheel(const plr_filter *f, const plr_measurement *m) {
    return judge(f, false, m, &m->by_wheel);
}
