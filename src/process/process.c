// SPDX-License-Identifier: MIT
#include "process/process.h"

#include "pelorus/assertions.h"
#include "state/seconds.h"

/* The largest step, m and rad. The series of SO(3) are accurate up to this angle. */
#define MAX_WAY  PLR_R(1000)
#define MAX_TURN PLR_R(3.1415926)

void plr_lay_out(plr_belief *belief, uint8_t velocity, uint8_t bias, uint8_t driver) {
    PLR_ASSERT(driver <= PLR_POSE_DIM + velocity + bias &&
               PLR_POSE_DIM + velocity + bias <= PLR_CORE_DIM);
    const uint8_t size[PLR_BLOCKS] = {PLR_POSE_DIM, velocity, bias};
    uint8_t row = 0;
    for (unsigned block = 0; block < PLR_BLOCKS; block++) {
        belief->layout.block[block].row = row;
        belief->layout.block[block].size = size[block];
        row = (uint8_t)(row + size[block]);
    }
    belief->layout.core = row;
    belief->layout.driver = driver;
    belief->layout.drivers = (uint8_t)(row - driver);
}

bool plr_step_is_possible(plr_real way2, plr_real turn2) {
    return way2 <= MAX_WAY * MAX_WAY && turn2 <= MAX_TURN * MAX_TURN;
}

void plr_mean_reading(const plr_belief *belief, const plr_source *source, uint8_t timing,
                      bool makes_up, plr_time_ns t_ns, const plr_real reading[PLR_READING_DIM],
                      plr_process_step *step) {
    const uint8_t when = source->reading_valid ? timing : PLR_TWIST_END;
    const bool cut =
        source->reading_valid && belief->t_ns > source->reading_ns && t_ns > belief->t_ns;
    /* of differences in ns, so that a short rest is as exact as a long one */
    const plr_real done_by_rest = makes_up && cut ? plr_seconds(belief->t_ns - source->reading_ns) /
                                                        plr_seconds(t_ns - belief->t_ns)
                                                  : PLR_R(0);
    for (int i = 0; i < PLR_READING_DIM; i++) {
        step->whole[i] = when == PLR_TWIST_END     ? reading[i]
                         : when == PLR_TWIST_START ? source->reading[i]
                                                   : PLR_R(0.5) * (source->reading[i] + reading[i]);
        step->mean[i] = PLR_FMA(done_by_rest, step->whole[i] - source->reading[i], step->whole[i]);
    }
}
