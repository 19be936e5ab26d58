// SPDX-License-Identifier: MIT
#include "filter/gate.h"

#include "filter/health.h"
#include "math/dense.h"
#include "math/small.h"
#include "state/covariance.h"
#include "state/model.h"

void plr_gate_innovation(plr_real r[3], const plr_observation *seen, const plr_linearisation *lin) {
    r[0] = (plr_real)seen->uL_px - lin->z[0];
    r[1] = (plr_real)seen->uR_px - lin->z[1];
    r[2] = PLR_R(0.5) * ((plr_real)seen->vL_px + (plr_real)seen->vR_px) - lin->z[2];
}

plr_real plr_gate_noise(const plr_filter *f, unsigned row) {
    return row == 2 ? PLR_R(0.5) * f->par.pixel_variance : f->par.pixel_variance;
}

/* The course's gate: squared norm of the four residuals, px^2. */
static plr_real residual_norm2(const plr_observation *seen, const plr_linearisation *lin) {
    const plr_real residual[4] = {
        (plr_real)seen->uL_px - lin->z[0], (plr_real)seen->uR_px - lin->z[1],
        (plr_real)seen->vL_px - lin->z[2], (plr_real)seen->vR_px - lin->z[2]};
    return PLR_FMA(residual[3], residual[3], plr_dot3(residual, residual));
}

/* A prediction that may be off by a focal length, one radian, says nothing about where to linearise:
 * such a landmark stands beside the camera or was never well known. Its variance would besides
 * shrink by more digits than float32 has. Known landmarks are let through: in localization from a
 * rough start it is the pose that is not known, and nothing else could tell it. */
static bool is_basis_for_linearisation(const plr_filter *f, const plr_real S[6]) {
    const plr_real limit = f->par.camera.fx * f->par.camera.fx;
    for (unsigned i = 0; i < PLR_ROWS; i++)
        if (!(S[plr_upper_row(PLR_ROWS, i)] <= limit))
            return false;
    return true;
}

bool plr_gate_accepts(const plr_filter *f, plr_real d2, plr_real residual2) {
    const bool fixed = f->par.gate_residual2 > 0;
    if (fixed && residual2 <= f->par.gate_residual2)
        return true;
    return (!fixed || plr_health_fixed_gate_is_open(f)) && plr_is_finite(d2) &&
           (f->par.gate_d2 <= 0 || d2 <= f->par.gate_d2);
}

plr_verdict plr_gate_judge(const plr_filter *f, unsigned slot, const plr_observation *seen) {
    plr_verdict verdict = {.accepted = false};
    plr_linearisation lin;
    if (!plr_model_of(f)->linearise(f, &f->slots[slot], &lin))
        return verdict;

    plr_real S[6], r[3];
    plr_covariance_innovation(f, slot, &lin, S);
    if (f->work.noise.open)
        plr_covariance_add_open_noise(f, slot, &lin, S);
    if (!f->slots[slot].known && !is_basis_for_linearisation(f, S))
        return verdict;
    for (unsigned i = 0; i < PLR_ROWS; i++)
        S[plr_upper_row(PLR_ROWS, i)] += plr_gate_noise(f, i);
    if (!plr_cholesky3(S))
        return verdict;
    plr_gate_innovation(r, seen, &lin);
    plr_solve3_transposed(1, S, r);
    const plr_real row_gap = (plr_real)seen->vL_px - (plr_real)seen->vR_px;
    verdict.d2 = plr_dot3(r, r) + row_gap * row_gap / (PLR_R(2) * f->par.pixel_variance);
    verdict.gain = S[0] * S[0] * S[3] * S[3] * S[5] * S[5];

    verdict.accepted = plr_gate_accepts(f, verdict.d2, residual_norm2(seen, &lin));
    return verdict;
}
