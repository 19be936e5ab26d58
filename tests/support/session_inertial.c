// SPDX-License-Identifier: MIT
#include "support/session_inertial.h"

#include <math.h>
#include <string.h>
#include <unity.h>

const inertial_manner inertial_plain = {.batch = 1};

plr_message inertial_header(void) {
    plr_message header = drive_header();
    header.as.header.process = PLR_PROCESS_IMU;
    return header;
}

void inertial_send_frame(const inertial_manner *how, int k) {
    plr_message frame = drive_stereo(INERTIAL_FRAME_S * k);
    frame.as.stereo.t_ns = drive_time_ns(INERTIAL_FRAME_S * k + how->camera_ahead_s);
    desk_send(frame);
}

void inertial_send_readings(const inertial_manner *how, int from, int end) {
    for (int n = from; n < end; n += (int)how->batch) {
        const int count = end - n < (int)how->batch ? end - n : (int)how->batch;
        if (how->twists)
            desk_send(drive_twist(INERTIAL_READING_S * n));
        desk_send(drive_imu(INERTIAL_READING_S * n, (unsigned)count, INERTIAL_READING_S));
    }
}

void inertial_send_drive(const inertial_manner *how) {
    const int late = (int)lround(how->frames_late_s / INERTIAL_FRAME_S);
    desk_send(how->without_header ? drive_header() : inertial_header());
    desk_send(drive_start(0));
    for (int k = 0; k < INERTIAL_FRAMES + late; k++) {
        inertial_send_readings(how, k == 0 ? 0 : INERTIAL_PER_FRAME * (k - 1) + 1,
                               INERTIAL_PER_FRAME * k + 1);
        if (k >= late)
            inertial_send_frame(how, k - late);
    }
}

void inertial_run(const inertial_manner *how) {
    desk_begin();
    inertial_send_drive(how);
    desk_run();
}

inertial_result inertial_read(void) {
    plr_message answer;
    inertial_result found;
    memset(&found, 0, sizeof found);
    while (faulty_port_answer_of(&port, PLR_KIND_POSE, &answer)) {
        found.pose = answer.as.pose;
        found.poses++;
    }
    faulty_port_answers_again(&port);
    return found;
}

inertial_result inertial_result_of(const inertial_manner *how) {
    desk_clear(1);
    inertial_run(how);
    return inertial_read();
}

void inertial_assert_same(const inertial_result *expected, const inertial_result *found) {
    TEST_ASSERT_EQUAL_UINT(expected->poses, found->poses);
    TEST_ASSERT_EQUAL_UINT64(expected->pose.t_ns, found->pose.t_ns);
    TEST_ASSERT_EQUAL_MEMORY(&expected->pose.T_WB, &found->pose.T_WB, sizeof found->pose.T_WB);
    TEST_ASSERT_EQUAL_MEMORY(expected->pose.P_xi, found->pose.P_xi, sizeof found->pose.P_xi);
    TEST_ASSERT_EQUAL_MEMORY(expected->pose.bias, found->pose.bias, sizeof found->pose.bias);
}
