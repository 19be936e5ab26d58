// SPDX-License-Identifier: MIT
/* MAVLink's ODOMETRY after every frame. A message that does not fit the ring is left out: the next
 * one is newer. Body axes that are neither forward-left-up nor forward-right-down cannot be
 * converted, and nothing is sent. */
#include "../mavlink/encode.h"
#include "../mavlink/odometry.h"
#include "serial.h"
#include "telemetry.h"

static void send_odometry(void *context, const plr_frame_result *result) {
    static uint8_t bytes[PLR_MAVLINK_FRAME_MAX];
    const plr_session *session = context;
    plr_odometry odometry;
    if (result->pose == NULL) {
        return;
    }
    if (plr_odometry_from_pose(&odometry, result->pose, (plr_body_axes)session->header.body_axes,
                               result->report->health) == PLR_OK) {
        (void)serial_write(&serial_telemetry, bytes, plr_odometry_encode(&odometry, bytes));
    }
}

plr_session_observer telemetry_observer(plr_session *session) {
    const plr_session_observer observer = {.context = session, .frame = send_odometry};
    serial_start(&serial_telemetry);
    return observer;
}
