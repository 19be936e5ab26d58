// SPDX-License-Identifier: MIT
#include "state/camera.h"

#include "math/se3.h"
#include "math/small.h"

void plr_camera_from_body(plr_real q[3], const plr_camera *camera, const plr_real s[3]) {
    plr_mat3_vec(q, camera->R_CB, s);
    for (int i = 0; i < 3; i++)
        q[i] += camera->t_CB[i];
}

void plr_camera_to_body(plr_real s[3], const plr_camera *camera, const plr_real q[3]) {
    plr_se3_inverse_point(s, camera->R_CB, camera->t_CB, q);
}

void plr_camera_motion(plr_real E_C[9], plr_real p_C[3], const plr_camera *camera,
                       const plr_real E[9], const plr_real p[3]) {
    plr_real RE[9], back[3];
    plr_mat3_mul(RE, camera->R_CB, E);
    plr_mat3_mul_nt(E_C, RE, camera->R_CB);
    plr_mat3_vec(p_C, camera->R_CB, p);
    plr_mat3_vec(back, E_C, camera->t_CB);
    for (int i = 0; i < 3; i++)
        p_C[i] -= back[i];
}
