// SPDX-License-Identifier: MIT
#include "support/cut_drive.h"

#include <string.h>
#include <unity.h>

#include "support/faulty_port.h"
#include "support/session_drive.h"
#include "support/wire_samples.h"

enum { ERASE = 1024, PROGRAM = 16 };

plr_session before_cut, after_restart;
plr_session_options cut_options;
faulty_port first_port, second_port;
faulty_flash cut_flash;
plr_state_store cut_store;
bool cut_by_imu;

void cut_clear(void) {
    cut_by_imu = false;
    faulty_port_init(&first_port, 1);
    faulty_port_init(&second_port, 2);
    faulty_flash_init(&cut_flash, 3, FAULTY_FLASH_BYTES, ERASE, PROGRAM);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_state_store_init(&cut_store, &cut_flash.device));
    plr_session_options_default(&cut_options);
    cut_options.store = &cut_store;
}

/* --- sending --- */

void cut_send(faulty_port *port, plr_message message) {
    faulty_port_send(port, &message);
}

plr_message cut_ask(plr_state_action action, plr_time_ns t_ns) {
    plr_message m;
    memset(&m, 0, sizeof m);
    m.kind = PLR_KIND_STATE;
    m.as.state.t_ns = t_ns;
    m.as.state.action = (uint8_t)action;
    return m;
}

plr_time_ns cut_frame_time(unsigned i) {
    return drive_time_ns(0.1 * i + 0.09);
}

void cut_begin(plr_session *s, faulty_port *port) {
    const plr_port functions = faulty_port_functions(port);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(s, &functions, &cut_options));
    plr_message header = drive_header();
    header.as.header.process = cut_by_imu ? PLR_PROCESS_IMU : PLR_PROCESS_TWIST;
    cut_send(port, header);
    cut_send(port, drive_config("slots", SLOTS));
}

void cut_run(plr_session *s) {
    while (plr_session_step(s) != PLR_STEP_CLOSED)
        continue;
}

void cut_drive(faulty_port *port, unsigned from, unsigned to) {
    for (unsigned i = from; i < to; i++) {
        for (unsigned k = 0; k < 4; k++) {
            const double t_s = 0.1 * i + 0.025 * k;
            cut_send(port, cut_by_imu ? drive_imu(t_s, 1, 0) : drive_twist(t_s));
        }
        cut_send(port, drive_stereo(0.1 * i + 0.09));
    }
}

/* The drive up to the cut, saved there. */
void cut_drive_and_save(void) {
    cut_begin(&before_cut, &first_port);
    cut_send(&first_port, drive_start(0));
    cut_drive(&first_port, 0, CUT);
    cut_send(&first_port, cut_ask(PLR_STATE_SAVE, 77));
    cut_run(&before_cut);
    TEST_ASSERT_EQUAL_UINT32(0, before_cut.totals.refused);
}

/* --- what comes back --- */

/* The next answer to a STATE, and the TEXT before it. */
plr_status cut_answer(faulty_port *port, plr_time_ns *t_ns, char *words) {
    plr_message answer;
    words[0] = '\0';
    while (faulty_port_answer(port, &answer)) {
        if (answer.kind == PLR_KIND_TEXT)
            strcpy(words, answer.as.text.text);
        if (answer.kind != PLR_KIND_REPORT || answer.as.report.subject != PLR_KIND_STATE)
            continue;
        *t_ns = answer.as.report.report.t_ns;
        return answer.as.report.report.status;
    }
    TEST_FAIL_MESSAGE("no REPORT of subject STATE");
    return PLR_E_IO;
}

void cut_assert_answered(faulty_port *port, plr_status status, const char *words) {
    char told[PLR_WIRE_MAX_TEXT + 1];
    plr_time_ns t_ns;
    TEST_ASSERT_EQUAL_INT(status, cut_answer(port, &t_ns, told));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(told, words), told);
}

/* Every POSE from frame CUT on: the payloads must be equal, reset_count included. */
void cut_assert_same_poses(void) {
    plr_message a, b;
    unsigned poses = 0;
    faulty_port_answers_again(&first_port);
    faulty_port_answers_again(&second_port);
    while (faulty_port_answer_of(&second_port, PLR_KIND_POSE, &b)) {
        do
            TEST_ASSERT_TRUE(faulty_port_answer_of(&first_port, PLR_KIND_POSE, &a));
        while (a.as.pose.t_ns < b.as.pose.t_ns);
        TEST_ASSERT_EQUAL_UINT64(cut_frame_time(CUT + poses), b.as.pose.t_ns);
        wire_assert_same(&a, &b);
        poses++;
    }
    TEST_ASSERT_EQUAL_UINT(LAST - CUT, poses);
}

void cut_assert_pose_x(double expected_m, double tolerance_m) {
    const plr_pose pose = pose_of(&after_restart.filter);
    TEST_ASSERT_DOUBLE_WITHIN(tolerance_m, expected_m, pose.p[0]);
}
