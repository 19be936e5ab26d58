// SPDX-License-Identifier: MIT
#include "state/model.h"

#include "math/small.h"

void plr_world_by_pose(const plr_real R_WB[9], const plr_real s[3],
                       plr_real J[PLR_ROWS * PLR_POSE_DIM]) {
    plr_real S[9], RS[9];
    plr_skew(S, s);
    plr_mat3_mul(RS, R_WB, S);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            J[PLR_POSE_DIM * i + j] = R_WB[3 * i + j];
            J[PLR_POSE_DIM * i + 3 + j] = -RS[3 * i + j];
        }
}
