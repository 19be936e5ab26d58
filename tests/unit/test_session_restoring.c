// SPDX-License-Identifier: MIT
/* STATE (restore): a drive was saved on its way, the power failed, and the session after it goes on. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "support/cut_drive.h"

void setUp(void) {
    cut_clear();
}

void tearDown(void) {
    TEST_ASSERT_EQUAL_UINT(0, cut_flash.violations);
}

/* --- restore --- */

static void assert_a_cut_changes_nothing(void) {
    cut_drive_and_save();
    cut_drive(&first_port, CUT, LAST);
    cut_run(&before_cut);
    cut_begin(&after_restart, &second_port);
    cut_send(&second_port,
             cut_ask(PLR_STATE_RESTORE, drive_time_ns(0.1 * CUT))); /* the first twist's */
    cut_drive(&second_port, CUT, LAST);
    cut_run(&after_restart);
    TEST_ASSERT_EQUAL_UINT32(0, after_restart.totals.refused);
    cut_assert_same_poses();
}

static void test_with_nothing_between_the_poses_are_those_of_a_drive_without_a_cut(void) {
    assert_a_cut_changes_nothing();
}

/* Velocity, biases of the IMU and the motion since the last frame are in the state. */
static void test_the_same_holds_of_a_drive_by_an_imu(void) {
    cut_by_imu = true;
    assert_a_cut_changes_nothing();
    TEST_ASSERT_EQUAL_UINT8(PLR_PROCESS_IMU, plr_filter_config(&after_restart.filter)->process);
}

static void test_the_settings_in_force_are_told_before_the_answer(void) {
    plr_message answer;
    cut_drive_and_save();
    cut_begin(&after_restart, &second_port);
    cut_send(&second_port, cut_ask(PLR_STATE_RESTORE, cut_frame_time(CUT - 1)));
    cut_run(&after_restart);
    TEST_ASSERT_TRUE(faulty_port_answer(&second_port, &answer));
    TEST_ASSERT_EQUAL_INT(PLR_KIND_CONFIG, answer.kind);
    TEST_ASSERT_TRUE(faulty_port_answer(&second_port, &answer));
    TEST_ASSERT_EQUAL_INT(PLR_KIND_TEXT, answer.kind);
    TEST_ASSERT_TRUE(faulty_port_answer(&second_port, &answer));
    TEST_ASSERT_EQUAL_INT(PLR_KIND_REPORT, answer.kind);
    TEST_ASSERT_EQUAL_UINT8(PLR_KIND_STATE, answer.as.report.subject);
    TEST_ASSERT_FALSE(faulty_port_answer(&second_port, &answer));
}

static void test_on_another_clock_the_body_stands_where_it_stood(void) {
    cut_drive_and_save();
    cut_begin(&after_restart, &second_port);
    cut_send(&second_port, cut_ask(PLR_STATE_RESTORE, 5));
    cut_run(&after_restart);
    TEST_ASSERT_EQUAL_UINT64(5, plr_filter_time(&after_restart.filter));
    const plr_pose saved = pose_of(&before_cut.filter);
    const plr_pose restored = pose_of(&after_restart.filter);
    TEST_ASSERT_EQUAL_MEMORY(&saved, &restored, sizeof saved);
}

static void test_what_may_have_moved_widens_the_covariance(void) {
    double before[36], after[36];
    plr_message restore = cut_ask(PLR_STATE_RESTORE, cut_frame_time(CUT - 1));
    cut_drive_and_save();
    for (unsigned i = 0; i < 6; i++)
        restore.as.state.moved_variance[i] = 0.5 + i;
    cut_begin(&after_restart, &second_port);
    cut_send(&second_port, restore);
    cut_run(&after_restart);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&before_cut.filter, before));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&after_restart.filter, after));
    for (unsigned i = 0; i < 6; i++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-5, before[7 * i] + 0.5 + i, after[7 * i]);
}

static void test_the_first_frame_is_new_at_whatever_time(void) {
    plr_message stereo = drive_stereo(0);
    cut_drive_and_save();
    stereo.as.stereo.t_ns = 0;
    cut_begin(&after_restart, &second_port);
    cut_send(&second_port, cut_ask(PLR_STATE_RESTORE, 0));
    cut_send(&second_port, stereo);
    cut_run(&after_restart);
    TEST_ASSERT_EQUAL_UINT32(0, after_restart.totals.refused);
}

/* Its poses are given, so nothing is known of how far it may have moved; its frames need no twist. */
static void test_mapping_goes_on_where_the_map_was(void) {
    const plr_message mapping = drive_config("mode", PLR_MODE_MAPPING);
    plr_message moved = cut_ask(PLR_STATE_RESTORE, 5);
    moved.as.state.moved_variance[0] = 1;
    cut_begin(&before_cut, &first_port);
    cut_send(&first_port, mapping);
    cut_send(&first_port, drive_truth(0.09));
    cut_send(&first_port, drive_stereo(0.09));
    cut_send(&first_port, cut_ask(PLR_STATE_SAVE, 0));
    cut_run(&before_cut);
    TEST_ASSERT_EQUAL_UINT32(0, before_cut.totals.refused);
    cut_begin(&after_restart, &second_port);
    cut_send(&second_port, mapping);
    cut_send(&second_port, moved);
    cut_send(&second_port, cut_ask(PLR_STATE_RESTORE, 5));
    cut_run(&after_restart);
    cut_assert_answered(&second_port, PLR_E_MODE, "not restored");
    cut_assert_answered(&second_port, PLR_OK, "state restored");
    TEST_ASSERT_EQUAL_UINT(SLOTS, plr_filter_landmark_count(&after_restart.filter));
}

/* Neither a START, before or behind it, nor a TRUTH, nor the option. */
static void restore_among_other_starts(plr_start_choice choice) {
    plr_message start = drive_start(0.1 * CUT), truth = drive_truth(0.1 * CUT);
    start.as.start.T_WB.p[0] = truth.as.truth.T_WB.p[0] = 500;
    cut_options.start = choice;
    cut_begin(&after_restart, &second_port);
    cut_send(&second_port, start);
    cut_send(&second_port, cut_ask(PLR_STATE_RESTORE, cut_frame_time(CUT - 1)));
    cut_send(&second_port, start);
    cut_send(&second_port, truth);
    cut_drive(&second_port, CUT, LAST);
    cut_run(&after_restart);
    TEST_ASSERT_EQUAL_UINT32(0, after_restart.totals.refused);
}

static void test_no_other_start_overrides_it(void) {
    for (unsigned choice = PLR_START_AUTO; choice <= PLR_START_RECORDED; choice++) {
        setUp();
        cut_drive_and_save();
        cut_drive(&first_port, CUT, LAST);
        cut_run(&before_cut);
        restore_among_other_starts((plr_start_choice)choice);
        cut_assert_same_poses();
    }
}

static void test_a_start_among_the_data_sets_the_pose_anew_as_ever(void) {
    plr_message start = drive_start(1.3);
    start.as.start.T_WB.p[0] = 500;
    cut_drive_and_save();
    cut_begin(&after_restart, &second_port);
    cut_send(&second_port, cut_ask(PLR_STATE_RESTORE, cut_frame_time(CUT - 1)));
    cut_drive(&second_port, CUT, CUT + 1);
    cut_send(&second_port, start);
    cut_run(&after_restart);
    cut_assert_pose_x(500, 0.5);
}

static void test_said_twice_it_is_done_twice(void) {
    cut_drive_and_save();
    cut_drive(&first_port, CUT, LAST);
    cut_run(&before_cut);
    cut_begin(&after_restart, &second_port);
    cut_send(&second_port, cut_ask(PLR_STATE_RESTORE, 5)); /* its answer was lost, say */
    cut_send(&second_port, cut_ask(PLR_STATE_RESTORE, cut_frame_time(CUT - 1)));
    cut_drive(&second_port, CUT, LAST);
    cut_run(&after_restart);
    cut_assert_answered(&second_port, PLR_OK, "state restored: generation 1");
    cut_assert_answered(&second_port, PLR_OK, "state restored: generation 1");
    cut_assert_same_poses();
}

static void test_in_the_midst_of_a_drive_it_is_refused(void) {
    cut_drive_and_save();
    const plr_time_ns t_ns = plr_filter_time(&before_cut.filter);
    cut_drive(&first_port, CUT, CUT + 1);
    cut_send(&first_port, cut_ask(PLR_STATE_RESTORE, t_ns));
    cut_run(&before_cut);
    cut_assert_answered(&first_port, PLR_OK, "state saved");
    cut_assert_answered(&first_port, PLR_E_MODE, "not restored: a drive is under way");
    TEST_ASSERT_EQUAL_UINT64(cut_frame_time(CUT), plr_filter_time(&before_cut.filter));
}

static void test_before_a_header_it_is_refused(void) {
    const plr_port functions = faulty_port_functions(&first_port);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(&before_cut, &functions, &cut_options));
    cut_send(&first_port, cut_ask(PLR_STATE_RESTORE, 0));
    cut_run(&before_cut);
    cut_assert_answered(&first_port, PLR_E_NOT_READY, "not restored: a HEADER must come first");
}

/* --- refused --- */

/* As a session that was never asked: START with its bias prior, and CONFIG, still count. */
static void goes_on_from_a_start(plr_message restore, plr_status status, const char *words) {
    plr_message start = drive_start(0.1 * CUT);
    double b[6];
    start.as.start.has_bias = true;
    for (unsigned i = 0; i < 6; i++) {
        start.as.start.bias[i] = 0.01;
        start.as.start.bias_variance[i] = 1e-4;
    }
    cut_begin(&after_restart, &second_port);
    cut_send(&second_port, restore);
    cut_send(&second_port, drive_config("bias", 1));
    cut_send(&second_port, start);
    cut_send(&second_port, drive_twist(0.1 * CUT));
    cut_run(&after_restart);
    cut_assert_answered(&second_port, status, words);
    TEST_ASSERT_EQUAL_UINT32(1, after_restart.totals.refused);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&after_restart.filter, b, NULL));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.01, b[0]);
    cut_assert_pose_x(start.as.start.T_WB.p[0], 1e-5);
}

static void test_a_device_that_was_never_used_is_refused(void) {
    goes_on_from_a_start(cut_ask(PLR_STATE_RESTORE, 0), PLR_E_NOT_READY, "nothing was ever saved");
}

static void test_a_state_of_another_setting_is_refused(void) {
    cut_drive_and_save();
    const plr_wire_setting other = {plr_setting_by_name("pixel-sigma")->id, 3};
    cut_options.overrides = &other;
    cut_options.override_count = 1;
    goes_on_from_a_start(cut_ask(PLR_STATE_RESTORE, 0), PLR_E_FOREIGN, "fits one calibration");
}

static void test_a_damaged_state_is_refused(void) {
    cut_drive_and_save();
    cut_flash.bytes[100] ^= 4;
    goes_on_from_a_start(cut_ask(PLR_STATE_RESTORE, 0), PLR_E_CORRUPT, "fail their check");
}

static void test_a_device_that_cannot_be_read_is_refused(void) {
    cut_drive_and_save();
    cut_flash.power = false;
    goes_on_from_a_start(cut_ask(PLR_STATE_RESTORE, 0), PLR_E_IO,
                         "not restored: the storage fails");
    cut_flash.power = true;
}

static void test_variances_without_sense_are_refused(void) {
    const struct {
        double value;
        plr_status status;
    } bad[] = {{-1e-9, PLR_E_ARGUMENT},
               {(double)NAN, PLR_E_NOT_FINITE},
               {(double)INFINITY, PLR_E_NOT_FINITE},
               {1e13, PLR_E_RANGE}};
    for (unsigned i = 0; i < sizeof bad / sizeof *bad; i++) {
        plr_message restore = cut_ask(PLR_STATE_RESTORE, 0);
        setUp();
        cut_drive_and_save();
        restore.as.state.moved_variance[i] = bad[i].value;
        goes_on_from_a_start(restore, bad[i].status, "not restored");
    }
}

/* A session that was never asked: CONFIG counts, and the pose is not known before a START. */
static void test_a_second_attempt_that_fails_takes_the_first_one_back(void) {
    plr_message start = drive_start(0.1 * CUT);
    cut_drive_and_save();
    cut_options.start = PLR_START_RECORDED;
    cut_begin(&after_restart, &second_port);
    cut_send(&second_port, cut_ask(PLR_STATE_RESTORE, 0));
    cut_run(&after_restart);
    cut_flash.bytes[100] ^= 4;
    start.as.start.T_WB.p[0] = 500;
    cut_send(&second_port, cut_ask(PLR_STATE_RESTORE, 0));
    cut_send(&second_port, drive_config("bias", 1));
    cut_send(&second_port, drive_stereo(0.1 * CUT - 0.01));
    cut_send(&second_port, start);
    cut_send(&second_port, drive_twist(0.1 * CUT));
    cut_run(&after_restart);
    cut_assert_answered(&second_port, PLR_OK, "restored");
    cut_assert_answered(&second_port, PLR_E_CORRUPT, "not restored");
    TEST_ASSERT_EQUAL_UINT32(2, after_restart.totals.refused); /* and the frame */
    TEST_ASSERT_EQUAL_INT(1, plr_filter_config(&after_restart.filter)->bias);
    cut_assert_pose_x(500, 1e-4);
}

static void test_settings_that_make_no_filter_are_refused(void) {
    plr_message header = drive_header();
    const plr_port functions = faulty_port_functions(&second_port);
    cut_drive_and_save();
    header.as.header.calibration.fx_px = -1;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(&after_restart, &functions, &cut_options));
    cut_send(&second_port, header);
    cut_send(&second_port, cut_ask(PLR_STATE_RESTORE, 0));
    cut_run(&after_restart);
    cut_assert_answered(&second_port, PLR_E_CONFIG, "not restored");
    TEST_ASSERT_EQUAL_UINT32(2, after_restart.totals.refused); /* the HEADER too */
}

static void assert_told_damage(bool damage) {
    char words[PLR_WIRE_MAX_TEXT + 1];
    plr_time_ns t_ns;
    TEST_ASSERT_EQUAL_INT(PLR_OK, cut_answer(&second_port, &t_ns, words));
    TEST_ASSERT_EQUAL_INT(damage, strstr(words, "; the other slot holds a damaged one") != NULL);
}

static void test_of_two_states_the_damaged_one_is_told(void) {
    cut_drive_and_save();
    cut_send(&first_port, cut_ask(PLR_STATE_SAVE, 0));
    cut_run(&before_cut);
    cut_begin(&after_restart, &second_port);
    cut_send(&second_port, cut_ask(PLR_STATE_RESTORE, 0));
    cut_run(&after_restart);
    cut_assert_answered(&second_port, PLR_OK, "generation 2, 8 landmarks, ");
    cut_flash.bytes[FAULTY_FLASH_BYTES / 2 + 100] ^= 4;
    cut_send(&second_port, cut_ask(PLR_STATE_RESTORE, 0));
    cut_run(&after_restart);
    cut_assert_answered(&second_port, PLR_OK, "generation 1, ");
    faulty_port_answers_again(&second_port);
    assert_told_damage(false);
    assert_told_damage(true);
}
