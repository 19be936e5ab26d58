// SPDX-License-Identifier: MIT
/* STATE: a drive is saved on the way, the power fails, and the session after it goes on. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "pelorus/session.h"
#include "pelorus/state_store.h"
#include "support/faulty_flash.h"
#include "support/faulty_port.h"
#include "support/session_drive.h"
#include "support/state_bytes.h"
#include "support/wire_samples.h"

enum { SLOTS = 8, ERASE = 1024, PROGRAM = 16, CUT = 12, LAST = 24 };

static plr_session before_cut, after_restart;
static plr_session_options options;
static faulty_port first_port, second_port;
static faulty_flash flash;
static plr_state_store store;

void setUp(void) {
    faulty_port_init(&first_port, 1);
    faulty_port_init(&second_port, 2);
    faulty_flash_init(&flash, 3, FAULTY_FLASH_BYTES, ERASE, PROGRAM);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_state_store_init(&store, &flash.device));
    plr_session_options_default(&options);
    options.store = &store;
}

void tearDown(void) {
    TEST_ASSERT_EQUAL_UINT(0, flash.violations);
}

/* --- sending --- */

static void send(faulty_port *port, plr_message message) {
    faulty_port_send(port, &message);
}

static plr_message state(plr_state_action action, plr_time_ns t_ns) {
    plr_message m;
    memset(&m, 0, sizeof m);
    m.kind = PLR_KIND_STATE;
    m.as.state.t_ns = t_ns;
    m.as.state.action = (uint8_t)action;
    return m;
}

static plr_time_ns frame_time(unsigned i) {
    return drive_time_ns(0.1 * i + 0.09);
}

static void begin(plr_session *s, faulty_port *port) {
    const plr_port functions = faulty_port_functions(port);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(s, &functions, &options));
    send(port, drive_header());
    send(port, drive_config("slots", SLOTS));
}

static void run(plr_session *s) {
    while (plr_session_step(s) != PLR_STEP_CLOSED)
        continue;
}

/* From frame to frame, ten a second, four twists before each. */
static void drive(faulty_port *port, unsigned from, unsigned to) {
    for (unsigned i = from; i < to; i++) {
        for (unsigned k = 0; k < 4; k++)
            send(port, drive_twist(0.1 * i + 0.025 * k));
        send(port, drive_stereo(0.1 * i + 0.09));
    }
}

/* The drive up to the cut, saved there. */
static void drive_and_save(void) {
    begin(&before_cut, &first_port);
    send(&first_port, drive_start(0));
    drive(&first_port, 0, CUT);
    send(&first_port, state(PLR_STATE_SAVE, 77));
    run(&before_cut);
    TEST_ASSERT_EQUAL_UINT32(0, before_cut.totals.refused);
}

/* --- what comes back --- */

/* The next answer to a STATE, and the TEXT before it. */
static plr_status answer_to_state(faulty_port *port, plr_time_ns *t_ns, char *words) {
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

static void assert_answered(faulty_port *port, plr_status status, const char *words) {
    char told[PLR_WIRE_MAX_TEXT + 1];
    plr_time_ns t_ns;
    TEST_ASSERT_EQUAL_INT(status, answer_to_state(port, &t_ns, told));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(told, words), told);
}

/* Every POSE from frame CUT on: the payloads must be equal, reset_count included. */
static void assert_same_poses(void) {
    plr_message a, b;
    unsigned poses = 0;
    faulty_port_answers_again(&first_port);
    faulty_port_answers_again(&second_port);
    while (faulty_port_answer_of(&second_port, PLR_KIND_POSE, &b)) {
        do
            TEST_ASSERT_TRUE(faulty_port_answer_of(&first_port, PLR_KIND_POSE, &a));
        while (a.as.pose.t_ns < b.as.pose.t_ns);
        TEST_ASSERT_EQUAL_UINT64(frame_time(CUT + poses), b.as.pose.t_ns);
        wire_assert_same(&a, &b);
        poses++;
    }
    TEST_ASSERT_EQUAL_UINT(LAST - CUT, poses);
}

static void assert_pose_x(double expected_m, double tolerance_m) {
    plr_pose pose;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose(&after_restart.filter, &pose));
    TEST_ASSERT_DOUBLE_WITHIN(tolerance_m, expected_m, pose.p[0]);
}

static void assert_told_damage(bool damage) {
    char words[PLR_WIRE_MAX_TEXT + 1];
    plr_time_ns t_ns;
    TEST_ASSERT_EQUAL_INT(PLR_OK, answer_to_state(&second_port, &t_ns, words));
    TEST_ASSERT_EQUAL_INT(damage, strstr(words, "; the other slot holds a damaged one") != NULL);
}

/* --- save --- */

static void test_a_save_is_answered_with_its_own_time_and_told_to_a_human(void) {
    char words[PLR_WIRE_MAX_TEXT + 1];
    plr_time_ns t_ns;
    drive_and_save();
    TEST_ASSERT_EQUAL_INT(PLR_OK, answer_to_state(&first_port, &t_ns, words));
    TEST_ASSERT_EQUAL_UINT64(77, t_ns);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(words, "state saved: generation 1, 8 landmarks, "), words);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(words, " bytes, of 1001.190 s"), words);
}

static void test_a_save_changes_no_bit_of_the_drive(void) {
    begin(&before_cut, &first_port);
    begin(&after_restart, &second_port);
    drive(&first_port, 0, LAST);
    for (unsigned i = 0; i < LAST; i++) {
        drive(&second_port, i, i + 1);
        send(&second_port, state(PLR_STATE_SAVE, 0));
    }
    run(&before_cut);
    run(&after_restart);
    before_cut.filter.map = after_restart.filter.map; /* each has its own session as context */
    TEST_ASSERT_TRUE(state_bytes_same_filter(&before_cut.filter, &after_restart.filter));
    TEST_ASSERT_EQUAL_UINT32(0, after_restart.totals.refused);
}

static void test_before_the_first_data_there_is_nothing_to_save(void) {
    const plr_port functions = faulty_port_functions(&first_port);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(&before_cut, &functions, &options));
    send(&first_port, state(PLR_STATE_SAVE, 0));
    send(&first_port, drive_header());
    send(&first_port, state(PLR_STATE_SAVE, 0));
    run(&before_cut);
    assert_answered(&first_port, PLR_E_NOT_READY, "not saved: no data was taken yet");
    assert_answered(&first_port, PLR_E_NOT_READY, "not saved: no data was taken yet");
    TEST_ASSERT_EQUAL_UINT64(0, flash.work);
}

static void test_data_that_was_refused_leaves_nothing_to_save(void) {
    plr_message twist = drive_twist(0);
    twist.as.twist.twist.v_B_mps[0] = 1e9;
    drive_and_save();
    begin(&after_restart, &second_port);
    send(&second_port, twist);
    send(&second_port, state(PLR_STATE_SAVE, 0));
    send(&second_port, drive_twist(0));
    send(&second_port, state(PLR_STATE_SAVE, 0));
    run(&after_restart);
    assert_answered(&second_port, PLR_E_NOT_READY, "not saved: no data was taken yet");
    assert_answered(&second_port, PLR_OK, "state saved: generation 2, 0 landmarks");
}

static void test_without_storage_both_are_refused_and_the_drive_goes_on(void) {
    options.store = NULL;
    begin(&before_cut, &first_port);
    send(&first_port, state(PLR_STATE_RESTORE, drive_time_ns(0)));
    send(&first_port, drive_start(0));
    drive(&first_port, 0, 3);
    send(&first_port, state(PLR_STATE_SAVE, 0));
    drive(&first_port, 3, 6);
    run(&before_cut);
    assert_answered(&first_port, PLR_E_MODE, "not restored: there is no storage");
    assert_answered(&first_port, PLR_E_MODE, "not saved: there is no storage");
    TEST_ASSERT_EQUAL_UINT32(2, before_cut.totals.refused);
    TEST_ASSERT_EQUAL_UINT64(frame_time(5), plr_filter_time(&before_cut.filter));
}

static void test_a_device_that_fails_is_told_and_the_drive_goes_on(void) {
    drive_and_save();
    assert_answered(&first_port, PLR_OK, "generation 1");
    flash.program_fails = true;
    drive(&first_port, CUT, CUT + 1);
    send(&first_port, state(PLR_STATE_SAVE, 0));
    drive(&first_port, CUT + 1, LAST);
    run(&before_cut);
    assert_answered(&first_port, PLR_E_IO, "not saved: the storage fails");
    TEST_ASSERT_EQUAL_UINT64(frame_time(LAST - 1), plr_filter_time(&before_cut.filter));
    flash.program_fails = false;
    begin(&after_restart, &second_port); /* and the old state is still there */
    send(&second_port, state(PLR_STATE_RESTORE, frame_time(CUT - 1)));
    run(&after_restart);
    assert_answered(&second_port, PLR_OK, "generation 1");
}

static void test_a_device_that_is_too_small_is_told_with_both_sizes(void) {
    flash.device.size = 2 * ERASE;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_state_store_init(&store, &flash.device));
    begin(&before_cut, &first_port);
    drive(&first_port, 0, 1);
    send(&first_port, state(PLR_STATE_SAVE, 0));
    run(&before_cut);
    assert_answered(&first_port, PLR_E_FULL, "the storage is too small: it has 2048 bytes, and ");
}

static void test_an_option_saves_at_the_end_of_every_drive(void) {
    plr_message end = {.kind = PLR_KIND_END};
    options.output |= PLR_OUTPUT_STATE;
    begin(&before_cut, &first_port);
    drive(&first_port, 0, CUT);
    send(&first_port, end);
    run(&before_cut);
    assert_answered(&first_port, PLR_OK, "state saved: generation 1");
    options.output &= ~(uint32_t)PLR_OUTPUT_STATE;
    options.start = PLR_START_SAVED;
    begin(&after_restart, &second_port);
    drive(&second_port, CUT, LAST);
    run(&after_restart);
    faulty_port_init(&first_port, 1);
    options.start = PLR_START_AUTO;
    begin(&before_cut, &first_port);
    drive(&first_port, 0, LAST);
    run(&before_cut);
    assert_same_poses();
}

/* --- restore --- */

static void test_with_nothing_between_the_poses_are_those_of_a_drive_without_a_cut(void) {
    drive_and_save();
    drive(&first_port, CUT, LAST);
    run(&before_cut);
    begin(&after_restart, &second_port);
    send(&second_port, state(PLR_STATE_RESTORE, drive_time_ns(0.1 * CUT))); /* the first twist's */
    drive(&second_port, CUT, LAST);
    run(&after_restart);
    TEST_ASSERT_EQUAL_UINT32(0, after_restart.totals.refused);
    assert_same_poses();
}

static void test_the_settings_in_force_are_told_before_the_answer(void) {
    plr_message answer;
    drive_and_save();
    begin(&after_restart, &second_port);
    send(&second_port, state(PLR_STATE_RESTORE, frame_time(CUT - 1)));
    run(&after_restart);
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
    plr_pose saved, restored;
    drive_and_save();
    begin(&after_restart, &second_port);
    send(&second_port, state(PLR_STATE_RESTORE, 5));
    run(&after_restart);
    TEST_ASSERT_EQUAL_UINT64(5, plr_filter_time(&after_restart.filter));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose(&before_cut.filter, &saved));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose(&after_restart.filter, &restored));
    TEST_ASSERT_EQUAL_MEMORY(&saved, &restored, sizeof saved);
}

static void test_what_may_have_moved_widens_the_covariance(void) {
    double before[36], after[36];
    plr_message restore = state(PLR_STATE_RESTORE, frame_time(CUT - 1));
    drive_and_save();
    for (unsigned i = 0; i < 6; i++)
        restore.as.state.moved_variance[i] = 0.5 + i;
    begin(&after_restart, &second_port);
    send(&second_port, restore);
    run(&after_restart);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&before_cut.filter, before));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_pose_covariance(&after_restart.filter, after));
    for (unsigned i = 0; i < 6; i++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-5, before[7 * i] + 0.5 + i, after[7 * i]);
}

static void test_the_first_frame_is_new_at_whatever_time(void) {
    plr_message stereo = drive_stereo(0);
    drive_and_save();
    stereo.as.stereo.t_ns = 0;
    begin(&after_restart, &second_port);
    send(&second_port, state(PLR_STATE_RESTORE, 0));
    send(&second_port, stereo);
    run(&after_restart);
    TEST_ASSERT_EQUAL_UINT32(0, after_restart.totals.refused);
}

/* Its poses are given, so nothing is known of how far it may have moved; its frames need no twist. */
static void test_mapping_goes_on_where_the_map_was(void) {
    const plr_message mapping = drive_config("mode", PLR_MODE_MAPPING);
    plr_message moved = state(PLR_STATE_RESTORE, 5);
    moved.as.state.moved_variance[0] = 1;
    begin(&before_cut, &first_port);
    send(&first_port, mapping);
    send(&first_port, drive_truth(0.09));
    send(&first_port, drive_stereo(0.09));
    send(&first_port, state(PLR_STATE_SAVE, 0));
    run(&before_cut);
    TEST_ASSERT_EQUAL_UINT32(0, before_cut.totals.refused);
    begin(&after_restart, &second_port);
    send(&second_port, mapping);
    send(&second_port, moved);
    send(&second_port, state(PLR_STATE_RESTORE, 5));
    run(&after_restart);
    assert_answered(&second_port, PLR_E_MODE, "not restored");
    assert_answered(&second_port, PLR_OK, "state restored");
    TEST_ASSERT_EQUAL_UINT(SLOTS, plr_filter_landmark_count(&after_restart.filter));
}

/* Neither a START, before or behind it, nor a TRUTH, nor the option. */
static void restore_among_other_starts(plr_start_choice choice) {
    plr_message start = drive_start(0.1 * CUT), truth = drive_truth(0.1 * CUT);
    start.as.start.T_WB.p[0] = truth.as.truth.T_WB.p[0] = 500;
    options.start = choice;
    begin(&after_restart, &second_port);
    send(&second_port, start);
    send(&second_port, state(PLR_STATE_RESTORE, frame_time(CUT - 1)));
    send(&second_port, start);
    send(&second_port, truth);
    drive(&second_port, CUT, LAST);
    run(&after_restart);
    TEST_ASSERT_EQUAL_UINT32(0, after_restart.totals.refused);
}

static void test_no_other_start_overrides_it(void) {
    for (unsigned choice = PLR_START_AUTO; choice <= PLR_START_RECORDED; choice++) {
        setUp();
        drive_and_save();
        drive(&first_port, CUT, LAST);
        run(&before_cut);
        restore_among_other_starts((plr_start_choice)choice);
        assert_same_poses();
    }
}

static void test_a_start_among_the_data_sets_the_pose_anew_as_ever(void) {
    plr_message start = drive_start(1.3);
    start.as.start.T_WB.p[0] = 500;
    drive_and_save();
    begin(&after_restart, &second_port);
    send(&second_port, state(PLR_STATE_RESTORE, frame_time(CUT - 1)));
    drive(&second_port, CUT, CUT + 1);
    send(&second_port, start);
    run(&after_restart);
    assert_pose_x(500, 0.5);
}

static void test_said_twice_it_is_done_twice(void) {
    drive_and_save();
    drive(&first_port, CUT, LAST);
    run(&before_cut);
    begin(&after_restart, &second_port);
    send(&second_port, state(PLR_STATE_RESTORE, 5)); /* its answer was lost, say */
    send(&second_port, state(PLR_STATE_RESTORE, frame_time(CUT - 1)));
    drive(&second_port, CUT, LAST);
    run(&after_restart);
    assert_answered(&second_port, PLR_OK, "state restored: generation 1");
    assert_answered(&second_port, PLR_OK, "state restored: generation 1");
    assert_same_poses();
}

static void test_in_the_midst_of_a_drive_it_is_refused(void) {
    drive_and_save();
    const plr_time_ns t_ns = plr_filter_time(&before_cut.filter);
    drive(&first_port, CUT, CUT + 1);
    send(&first_port, state(PLR_STATE_RESTORE, t_ns));
    run(&before_cut);
    assert_answered(&first_port, PLR_OK, "state saved");
    assert_answered(&first_port, PLR_E_MODE, "not restored: a drive is under way");
    TEST_ASSERT_EQUAL_UINT64(frame_time(CUT), plr_filter_time(&before_cut.filter));
}

static void test_before_a_header_it_is_refused(void) {
    const plr_port functions = faulty_port_functions(&first_port);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(&before_cut, &functions, &options));
    send(&first_port, state(PLR_STATE_RESTORE, 0));
    run(&before_cut);
    assert_answered(&first_port, PLR_E_NOT_READY, "not restored: a HEADER must come first");
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
    begin(&after_restart, &second_port);
    send(&second_port, restore);
    send(&second_port, drive_config("bias", 1));
    send(&second_port, start);
    send(&second_port, drive_twist(0.1 * CUT));
    run(&after_restart);
    assert_answered(&second_port, status, words);
    TEST_ASSERT_EQUAL_UINT32(1, after_restart.totals.refused);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_bias(&after_restart.filter, b, NULL));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0.01, b[0]);
    assert_pose_x(start.as.start.T_WB.p[0], 1e-5);
}

static void test_a_device_that_was_never_used_is_refused(void) {
    goes_on_from_a_start(state(PLR_STATE_RESTORE, 0), PLR_E_NOT_READY, "nothing was ever saved");
}

static void test_a_state_of_another_setting_is_refused(void) {
    drive_and_save();
    const plr_wire_setting other = {plr_setting_by_name("pixel-sigma")->id, 3};
    options.overrides = &other;
    options.override_count = 1;
    goes_on_from_a_start(state(PLR_STATE_RESTORE, 0), PLR_E_FOREIGN, "fits one calibration");
}

static void test_a_damaged_state_is_refused(void) {
    drive_and_save();
    flash.bytes[100] ^= 4;
    goes_on_from_a_start(state(PLR_STATE_RESTORE, 0), PLR_E_CORRUPT, "fail their check");
}

static void test_a_device_that_cannot_be_read_is_refused(void) {
    drive_and_save();
    flash.power = false;
    goes_on_from_a_start(state(PLR_STATE_RESTORE, 0), PLR_E_IO, "not restored: the storage fails");
    flash.power = true;
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
        plr_message restore = state(PLR_STATE_RESTORE, 0);
        setUp();
        drive_and_save();
        restore.as.state.moved_variance[i] = bad[i].value;
        goes_on_from_a_start(restore, bad[i].status, "not restored");
    }
}

/* A session that was never asked: CONFIG counts, and the pose is not known before a START. */
static void test_a_second_attempt_that_fails_takes_the_first_one_back(void) {
    plr_message start = drive_start(0.1 * CUT);
    drive_and_save();
    options.start = PLR_START_RECORDED;
    begin(&after_restart, &second_port);
    send(&second_port, state(PLR_STATE_RESTORE, 0));
    run(&after_restart);
    flash.bytes[100] ^= 4;
    start.as.start.T_WB.p[0] = 500;
    send(&second_port, state(PLR_STATE_RESTORE, 0));
    send(&second_port, drive_config("bias", 1));
    send(&second_port, drive_stereo(0.1 * CUT - 0.01));
    send(&second_port, start);
    send(&second_port, drive_twist(0.1 * CUT));
    run(&after_restart);
    assert_answered(&second_port, PLR_OK, "restored");
    assert_answered(&second_port, PLR_E_CORRUPT, "not restored");
    TEST_ASSERT_EQUAL_UINT32(2, after_restart.totals.refused); /* and the frame */
    TEST_ASSERT_EQUAL_INT(1, plr_filter_config(&after_restart.filter)->bias);
    assert_pose_x(500, 1e-4);
}

static void test_settings_that_make_no_filter_are_refused(void) {
    plr_message header = drive_header();
    const plr_port functions = faulty_port_functions(&second_port);
    drive_and_save();
    header.as.header.calibration.fx_px = -1;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(&after_restart, &functions, &options));
    send(&second_port, header);
    send(&second_port, state(PLR_STATE_RESTORE, 0));
    run(&after_restart);
    assert_answered(&second_port, PLR_E_CONFIG, "not restored");
    TEST_ASSERT_EQUAL_UINT32(2, after_restart.totals.refused); /* the HEADER too */
}

static void test_of_two_states_the_damaged_one_is_told(void) {
    drive_and_save();
    send(&first_port, state(PLR_STATE_SAVE, 0));
    run(&before_cut);
    begin(&after_restart, &second_port);
    send(&second_port, state(PLR_STATE_RESTORE, 0));
    run(&after_restart);
    assert_answered(&second_port, PLR_OK, "generation 2, 8 landmarks, ");
    flash.bytes[FAULTY_FLASH_BYTES / 2 + 100] ^= 4;
    send(&second_port, state(PLR_STATE_RESTORE, 0));
    run(&after_restart);
    assert_answered(&second_port, PLR_OK, "generation 1, ");
    faulty_port_answers_again(&second_port);
    assert_told_damage(false);
    assert_told_damage(true);
}

/* --- by option --- */

static void test_who_asks_for_the_saved_state_gets_it_at_the_first_data(void) {
    drive_and_save();
    drive(&first_port, CUT, LAST);
    run(&before_cut);
    options.start = PLR_START_SAVED;
    begin(&after_restart, &second_port);
    drive(&second_port, CUT, LAST);
    run(&after_restart);
    assert_answered(&second_port, PLR_OK, "state restored: generation 1");
    assert_same_poses();
}

static void test_who_asks_for_the_saved_state_on_another_clock_goes_on_there(void) {
    plr_message twist = drive_twist(0);
    drive_and_save();
    options.start = PLR_START_SAVED;
    twist.as.twist.t_ns = 5;
    begin(&after_restart, &second_port);
    send(&second_port, twist);
    run(&after_restart);
    TEST_ASSERT_EQUAL_UINT32(0, after_restart.totals.refused);
    TEST_ASSERT_EQUAL_UINT64(5, plr_filter_time(&after_restart.filter));
    TEST_ASSERT_EQUAL_UINT(SLOTS, plr_filter_landmark_count(&after_restart.filter));
}

static void test_who_asks_for_the_saved_state_and_has_none_needs_a_start(void) {
    options.start = PLR_START_SAVED;
    begin(&after_restart, &second_port);
    drive(&second_port, 0, 2);
    run(&after_restart);
    assert_answered(&second_port, PLR_E_NOT_READY, "nothing was ever saved");
    TEST_ASSERT_EQUAL_UINT32(3, after_restart.totals.refused); /* and both frames */
    send(&second_port, drive_start(0.2));
    drive(&second_port, 2, 3);
    run(&after_restart);
    TEST_ASSERT_EQUAL_UINT32(3, after_restart.totals.refused);
}

/* --- logs --- */

static void collect(faulty_port *from, faulty_port *to) {
    plr_message message;
    faulty_port_answers_again(from);
    while (faulty_port_answer(from, &message))
        faulty_port_send(to, &message);
}

static void test_a_log_holds_both_requests(void) {
    plr_message message;
    options.output |= PLR_OUTPUT_ECHO;
    drive_and_save();
    begin(&after_restart, &second_port);
    send(&second_port, state(PLR_STATE_RESTORE, 5));
    run(&after_restart);
    TEST_ASSERT_TRUE(faulty_port_answer_of(&first_port, PLR_KIND_STATE, &message));
    TEST_ASSERT_EQUAL_UINT8(PLR_STATE_SAVE, message.as.state.action);
    TEST_ASSERT_TRUE(faulty_port_answer_of(&second_port, PLR_KIND_STATE, &message));
    TEST_ASSERT_EQUAL_UINT8(PLR_STATE_RESTORE, message.as.state.action);
}

static void test_the_log_of_a_restored_drive_gives_its_bits_where_the_state_is(void) {
    static faulty_port replay_port;
    static plr_session replay;
    drive_and_save();
    options.output |= PLR_OUTPUT_ECHO;
    begin(&after_restart, &second_port);
    send(&second_port, state(PLR_STATE_RESTORE, frame_time(CUT - 1)));
    drive(&second_port, CUT, LAST);
    run(&after_restart);
    faulty_port_init(&replay_port, 4);
    const plr_port functions = faulty_port_functions(&replay_port);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(&replay, &functions, &options));
    collect(&second_port, &replay_port);
    run(&replay);
    TEST_ASSERT_EQUAL_UINT32(0, replay.totals.refused);
    replay.filter.map = after_restart.filter.map;
    TEST_ASSERT_TRUE(state_bytes_same_filter(&replay.filter, &after_restart.filter));
}

int main(void) {
    UNITY_BEGIN();
    RUN_TEST(test_a_save_is_answered_with_its_own_time_and_told_to_a_human);
    RUN_TEST(test_a_save_changes_no_bit_of_the_drive);
    RUN_TEST(test_before_the_first_data_there_is_nothing_to_save);
    RUN_TEST(test_data_that_was_refused_leaves_nothing_to_save);
    RUN_TEST(test_without_storage_both_are_refused_and_the_drive_goes_on);
    RUN_TEST(test_a_device_that_fails_is_told_and_the_drive_goes_on);
    RUN_TEST(test_a_device_that_is_too_small_is_told_with_both_sizes);
    RUN_TEST(test_an_option_saves_at_the_end_of_every_drive);
    RUN_TEST(test_with_nothing_between_the_poses_are_those_of_a_drive_without_a_cut);
    RUN_TEST(test_the_settings_in_force_are_told_before_the_answer);
    RUN_TEST(test_on_another_clock_the_body_stands_where_it_stood);
    RUN_TEST(test_what_may_have_moved_widens_the_covariance);
    RUN_TEST(test_the_first_frame_is_new_at_whatever_time);
    RUN_TEST(test_mapping_goes_on_where_the_map_was);
    RUN_TEST(test_no_other_start_overrides_it);
    RUN_TEST(test_a_start_among_the_data_sets_the_pose_anew_as_ever);
    RUN_TEST(test_said_twice_it_is_done_twice);
    RUN_TEST(test_in_the_midst_of_a_drive_it_is_refused);
    RUN_TEST(test_before_a_header_it_is_refused);
    RUN_TEST(test_a_device_that_was_never_used_is_refused);
    RUN_TEST(test_a_state_of_another_setting_is_refused);
    RUN_TEST(test_a_damaged_state_is_refused);
    RUN_TEST(test_a_device_that_cannot_be_read_is_refused);
    RUN_TEST(test_variances_without_sense_are_refused);
    RUN_TEST(test_a_second_attempt_that_fails_takes_the_first_one_back);
    RUN_TEST(test_settings_that_make_no_filter_are_refused);
    RUN_TEST(test_of_two_states_the_damaged_one_is_told);
    RUN_TEST(test_who_asks_for_the_saved_state_gets_it_at_the_first_data);
    RUN_TEST(test_who_asks_for_the_saved_state_on_another_clock_goes_on_there);
    RUN_TEST(test_who_asks_for_the_saved_state_and_has_none_needs_a_start);
    RUN_TEST(test_a_log_holds_both_requests);
    RUN_TEST(test_the_log_of_a_restored_drive_gives_its_bits_where_the_state_is);
    return UNITY_END();
}
