// SPDX-License-Identifier: MIT
#include "vision/watch.h"

#include "math/finite.h"
#include "math/validate.h"

enum { SIDE_MIN = 48, SIDE_MAX = 4096 };

#define APART_MAX_NS   250000000U /* between the halves of a pair */
#define ROW_TIME_MAX_S 1e-3
#define FAR            1e6 /* px and m of a calibration */
#define MOTION_MAX_M   100.0
#define SPEED_MAX_MPS  1e3
#define RATE_MAX_RADPS 100.0

static plr_status check_lens(const plr_lens *lens) {
    if (lens->model > PLR_LENS_EQUIDISTANT || lens->width_px < SIDE_MIN ||
        lens->height_px < SIDE_MIN || lens->width_px > SIDE_MAX || lens->height_px > SIDE_MAX)
        return PLR_E_ARGUMENT;
    if (!plr_all_finite(&lens->fx_px, 4) || !plr_all_finite(lens->k, 8))
        return PLR_E_NOT_FINITE;
    const bool far = !plr_all_within(&lens->fx_px, 4, FAR) || !plr_all_within(lens->k, 8, FAR);
    return far || lens->fx_px < 1 || lens->fy_px < 1 ? PLR_E_CALIBRATION : PLR_OK;
}

plr_status plr_check_rig(const plr_rig *rig) {
    plr_status status = check_lens(&rig->left);
    if (status == PLR_OK)
        status = check_lens(&rig->right);
    if (status != PLR_OK)
        return status;
    if (rig->left.width_px != rig->right.width_px || rig->left.height_px != rig->right.height_px ||
        !(rig->row_time_s >= 0 && rig->row_time_s <= ROW_TIME_MAX_S) ||
        rig->tracks > PLR_VISION_TRACKS || rig->disparity_max_px > rig->left.width_px)
        return PLR_E_ARGUMENT;
    if ((uint32_t)rig->left.width_px * rig->left.height_px > PLR_VISION_PIXELS)
        return PLR_E_RANGE;
    if (!plr_all_finite(rig->T_RL.R, 9) || !plr_all_finite(rig->T_RL.p, 3) ||
        !plr_all_finite(&rig->fx_px, 4))
        return PLR_E_NOT_FINITE;
    const bool own = rig->fx_px != 0;
    if (!plr_is_rotation(rig->T_RL.R) || !plr_all_within(rig->T_RL.p, 3, FAR) ||
        (own && (rig->fx_px < 1 || rig->fy_px < 1 || !plr_all_within(&rig->fx_px, 4, FAR))))
        return PLR_E_CALIBRATION;
    return PLR_OK;
}

static bool fits(const plr_vision *v, const plr_picture *p) {
    return p->pixels && p->width_px == v->width && p->height_px == v->height &&
           p->stride >= p->width_px && p->stride <= UINT32_MAX / SIDE_MAX;
}

plr_status plr_check_pair(const plr_vision *v, const plr_picture_pair *pair) {
    if (!fits(v, &pair->left) || !fits(v, &pair->right))
        return PLR_E_ARGUMENT;
    const plr_time_ns left = pair->left.t_ns, right = pair->right.t_ns;
    if ((left > right ? left - right : right - left) > APART_MAX_NS || left > UINT64_MAX / 4 ||
        (v->has_pair && left <= v->t_ns))
        return PLR_E_TIME;
    return PLR_OK;
}

plr_status plr_check_expected(const plr_expected *e) {
    if (!e)
        return PLR_OK;
    if (e->depth_count > 0 && !e->depths)
        return PLR_E_ARGUMENT;
    const bool moves = e->velocity_known;
    if (!plr_all_finite(e->motion.R, 9) || !plr_all_finite(e->motion.p, 3) ||
        (moves && !(plr_all_finite(e->v_C_mps, 3) && plr_all_finite(e->w_C_radps, 3))))
        return PLR_E_NOT_FINITE;
    if (!plr_is_rotation(e->motion.R) || !plr_all_within(e->motion.p, 3, MOTION_MAX_M) ||
        (moves && !(plr_all_within(e->v_C_mps, 3, SPEED_MAX_MPS) &&
                    plr_all_within(e->w_C_radps, 3, RATE_MAX_RADPS))))
        return PLR_E_RANGE;
    return PLR_OK;
}
