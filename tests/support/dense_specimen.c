// SPDX-License-Identifier: MIT
#include "support/dense_specimen.h"

#include <stdlib.h>

#include "support/dense_parts.h"
#include "support/matrices.h"

void specimen_twin(const plr_filter *f, dense_ekf *e) {
    const plr_camera *camera = &f->par.camera;
    plr_calibration calibration = {.fx_px = (double)camera->fx,
                                   .fy_px = (double)camera->fy,
                                   .cx_px = (double)camera->cx,
                                   .cy_px = (double)camera->cy,
                                   .baseline_m = (double)camera->baseline};
    plr_pose T_WB;
    to_doubles(calibration.T_CB.R, camera->R_CB, 9);
    to_doubles(calibration.T_CB.p, camera->t_CB, 3);
    dense_init(e, &calibration, &f->config);
    if (plr_filter_pose(f, &T_WB) != PLR_OK)
        abort();
    dense_motion(e->T_WB, &T_WB);
}
