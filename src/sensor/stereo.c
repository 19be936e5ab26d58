// SPDX-License-Identifier: MIT
#include "sensor/stereo.h"

#include "math/small.h"
#include "pelorus/assertions.h"

void plr_stereo_project(plr_real z[3], const plr_camera *camera, const plr_real q[3]) {
    PLR_ASSERT(q[2] < 0 || q[2] > 0);
    const plr_real inverse = PLR_R(1) / q[2];
    z[0] = PLR_FMA(camera->fx * q[0], inverse, camera->cx);
    z[1] = PLR_FMA(camera->fx * (q[0] - camera->baseline), inverse, camera->cx);
    z[2] = PLR_FMA(camera->fy * q[1], inverse, camera->cy);
}

void plr_stereo_jacobian(plr_real Dz[9], const plr_camera *camera, const plr_real q[3]) {
    PLR_ASSERT(q[2] < 0 || q[2] > 0);
    const plr_real inverse = PLR_R(1) / q[2];
    const plr_real fx = camera->fx * inverse, fy = camera->fy * inverse;
    const plr_real rows[9] = {
        fx, 0,  -fx * q[0] * inverse,                      /* uL */
        fx, 0,  -fx * (q[0] - camera->baseline) * inverse, /* uR */
        0,  fy, -fy * q[1] * inverse,                      /* v */
    };
    memcpy(Dz, rows, sizeof rows);
}

void plr_stereo_back_project(plr_real q[3], plr_real Dq[9], const plr_camera *camera,
                             const plr_real z[3]) {
    PLR_ASSERT(z[0] - z[1] > 0);
    const plr_real inverse = PLR_R(1) / (z[0] - z[1]);
    const plr_real scale = camera->baseline * inverse; /* m per px in x */
    const plr_real aspect = camera->fx / camera->fy;
    q[0] = (z[0] - camera->cx) * scale;
    q[1] = (z[2] - camera->cy) * scale * aspect;
    q[2] = camera->fx * scale;
    for (int i = 0; i < 3; i++) {
        Dq[3 * i + 0] = -q[i] * inverse;
        Dq[3 * i + 1] = q[i] * inverse;
        Dq[3 * i + 2] = 0;
    }
    Dq[0] += scale;
    Dq[5] = scale * aspect;
}
