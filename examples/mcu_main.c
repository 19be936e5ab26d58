// SPDX-License-Identifier: MIT
/*
 * The main loop of a controller: static memory, no heap, no stdio. The functions below are
 * yours: they show what interrupts have queued, and send. A frame goes in behind the last reading
 * of the IMU that is not later, so it waits until the IMU has passed it.
 *
 *     arm-none-eabi-gcc -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16 -O2
 *         -ffp-contract=off -fno-math-errno -DPLR_MAX_LANDMARKS=16 -Iinclude -Isrc -c ...
 *
 * A whole firmware with link, saved state, watchdog and fault handlers: port/cortex_m.
 */
#include <stdbool.h>
#include <stddef.h>

#include "pelorus/pelorus.h"

typedef struct stamped_imu {
    plr_time_ns t_ns; /* of the clock that stamps the frames, too */
    plr_imu reading;
} stamped_imu;

/* The oldest that is queued, or NULL. It stays there until it is done with. */
const stamped_imu *board_imu(void);
void board_imu_done(void);
const plr_frame *board_frame(void);
void board_frame_done(void);
/* After each frame. Returns false where the robot is switched off. */
bool board_answer(const plr_filter *filter, const plr_report *report);

static plr_filter filter; /* 26 KB with 16 landmarks: docs/SIZES.md */

static const plr_calibration camera = {.fx_px = 450,
                                       .fy_px = 450,
                                       .cx_px = 320,
                                       .cy_px = 240,
                                       .baseline_m = 0.12,
                                       .T_CB = {.R = {0, -1, 0, 0, 0, -1, 1, 0, 0}}};

static plr_status begin(void) {
    plr_config config;
    plr_config_default(&config);
    config.process = PLR_PROCESS_IMU;
    config.slots = 16;
    return plr_filter_init(&filter, &camera, &config, NULL);
}

/* Takes the readings that are not later than the frame. True where the IMU has come so far. */
static bool readings_until(plr_time_ns frame_ns) {
    const stamped_imu *next;
    while ((next = board_imu()) != NULL && next->t_ns <= frame_ns) {
        /* what is refused is counted, and told by the next report */
        (void)plr_filter_inertial(&filter, next->t_ns, &next->reading);
        board_imu_done();
    }
    return next != NULL;
}

int main(void) {
    if (begin() != PLR_OK) {
        return 1;
    }
    for (;;) {
        const plr_frame *frame = board_frame();
        if (frame == NULL || !readings_until(frame->t_ns)) {
            continue; /* on a board: sleep until the next interrupt */
        }
        plr_report report; /* health and reasons, also of a frame that is refused */
        (void)plr_filter_update(&filter, frame, &report);
        board_frame_done();
        if (!board_answer(&filter, &report)) {
            return 0;
        }
    }
}
