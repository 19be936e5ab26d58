// SPDX-License-Identifier: MIT
/* STATE (save), and what brings a saved state back by option or from a log. */
#include <string.h>
#include <unity.h>

#include "support/cut_drive.h"
#include "support/state_bytes.h"

void setUp(void) {
    cut_clear();
}

void tearDown(void) {
    TEST_ASSERT_EQUAL_UINT(0, cut_flash.violations);
}

/* --- save --- */

static void test_a_save_is_answered_with_its_own_time_and_told_to_a_human(void) {
    char words[PLR_WIRE_MAX_TEXT + 1];
    plr_time_ns t_ns;
    cut_drive_and_save();
    TEST_ASSERT_EQUAL_INT(PLR_OK, cut_answer(&first_port, &t_ns, words));
    TEST_ASSERT_EQUAL_UINT64(77, t_ns);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(words, "state saved: generation 1, 8 landmarks, "), words);
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(words, " bytes, of 1001.190 s"), words);
}

static void test_a_save_changes_no_bit_of_the_drive(void) {
    cut_begin(&before_cut, &first_port);
    cut_begin(&after_restart, &second_port);
    cut_drive(&first_port, 0, LAST);
    for (unsigned i = 0; i < LAST; i++) {
        cut_drive(&second_port, i, i + 1);
        cut_send(&second_port, cut_ask(PLR_STATE_SAVE, 0));
    }
    cut_run(&before_cut);
    cut_run(&after_restart);
    before_cut.filter.map = after_restart.filter.map; /* each has its own session as context */
    TEST_ASSERT_TRUE(state_bytes_same_filter(&before_cut.filter, &after_restart.filter));
    TEST_ASSERT_EQUAL_UINT32(0, after_restart.totals.refused);
}

static void test_before_the_first_data_there_is_nothing_to_save(void) {
    const plr_port functions = faulty_port_functions(&first_port);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(&before_cut, &functions, &cut_options));
    cut_send(&first_port, cut_ask(PLR_STATE_SAVE, 0));
    cut_send(&first_port, drive_header());
    cut_send(&first_port, cut_ask(PLR_STATE_SAVE, 0));
    cut_run(&before_cut);
    cut_assert_answered(&first_port, PLR_E_NOT_READY, "not saved: no data was taken yet");
    cut_assert_answered(&first_port, PLR_E_NOT_READY, "not saved: no data was taken yet");
    TEST_ASSERT_EQUAL_UINT64(0, cut_flash.work);
}

static void test_data_that_was_refused_leaves_nothing_to_save(void) {
    plr_message twist = drive_twist(0);
    twist.as.twist.twist.v_B_mps[0] = 1e9;
    cut_drive_and_save();
    cut_begin(&after_restart, &second_port);
    cut_send(&second_port, twist);
    cut_send(&second_port, cut_ask(PLR_STATE_SAVE, 0));
    cut_send(&second_port, drive_twist(0));
    cut_send(&second_port, cut_ask(PLR_STATE_SAVE, 0));
    cut_run(&after_restart);
    cut_assert_answered(&second_port, PLR_E_NOT_READY, "not saved: no data was taken yet");
    cut_assert_answered(&second_port, PLR_OK, "state saved: generation 2, 0 landmarks");
}

static void test_without_storage_both_are_refused_and_the_drive_goes_on(void) {
    cut_options.store = NULL;
    cut_begin(&before_cut, &first_port);
    cut_send(&first_port, cut_ask(PLR_STATE_RESTORE, drive_time_ns(0)));
    cut_send(&first_port, drive_start(0));
    cut_drive(&first_port, 0, 3);
    cut_send(&first_port, cut_ask(PLR_STATE_SAVE, 0));
    cut_drive(&first_port, 3, 6);
    cut_run(&before_cut);
    cut_assert_answered(&first_port, PLR_E_MODE, "not restored: there is no storage");
    cut_assert_answered(&first_port, PLR_E_MODE, "not saved: there is no storage");
    TEST_ASSERT_EQUAL_UINT32(2, before_cut.totals.refused);
    TEST_ASSERT_EQUAL_UINT64(cut_frame_time(5), plr_filter_time(&before_cut.filter));
}

static void test_a_device_that_fails_is_told_and_the_drive_goes_on(void) {
    cut_drive_and_save();
    cut_assert_answered(&first_port, PLR_OK, "generation 1");
    cut_flash.program_fails = true;
    cut_drive(&first_port, CUT, CUT + 1);
    cut_send(&first_port, cut_ask(PLR_STATE_SAVE, 0));
    cut_drive(&first_port, CUT + 1, LAST);
    cut_run(&before_cut);
    cut_assert_answered(&first_port, PLR_E_IO, "not saved: the storage fails");
    TEST_ASSERT_EQUAL_UINT64(cut_frame_time(LAST - 1), plr_filter_time(&before_cut.filter));
    cut_flash.program_fails = false;
    cut_begin(&after_restart, &second_port); /* and the old state is still there */
    cut_send(&second_port, cut_ask(PLR_STATE_RESTORE, cut_frame_time(CUT - 1)));
    cut_run(&after_restart);
    cut_assert_answered(&second_port, PLR_OK, "generation 1");
}

static void test_a_device_that_is_too_small_is_told_with_both_sizes(void) {
    cut_flash.device.size = 2 * cut_flash.device.erase_size;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_state_store_init(&cut_store, &cut_flash.device));
    cut_begin(&before_cut, &first_port);
    cut_drive(&first_port, 0, 1);
    cut_send(&first_port, cut_ask(PLR_STATE_SAVE, 0));
    cut_run(&before_cut);
    cut_assert_answered(&first_port, PLR_E_FULL,
                        "the storage is too small: it has 2048 bytes, and ");
}

static void test_an_option_saves_at_the_end_of_every_drive(void) {
    plr_message end = {.kind = PLR_KIND_END};
    cut_options.output |= PLR_OUTPUT_STATE;
    cut_begin(&before_cut, &first_port);
    cut_drive(&first_port, 0, CUT);
    cut_send(&first_port, end);
    cut_run(&before_cut);
    cut_assert_answered(&first_port, PLR_OK, "state saved: generation 1");
    cut_options.output &= ~(uint32_t)PLR_OUTPUT_STATE;
    cut_options.start = PLR_START_SAVED;
    cut_begin(&after_restart, &second_port);
    cut_drive(&second_port, CUT, LAST);
    cut_run(&after_restart);
    faulty_port_init(&first_port, 1);
    cut_options.start = PLR_START_AUTO;
    cut_begin(&before_cut, &first_port);
    cut_drive(&first_port, 0, LAST);
    cut_run(&before_cut);
    cut_assert_same_poses();
}

/* --- by option --- */

static void test_who_asks_for_the_saved_state_gets_it_at_the_first_data(void) {
    cut_drive_and_save();
    cut_drive(&first_port, CUT, LAST);
    cut_run(&before_cut);
    cut_options.start = PLR_START_SAVED;
    cut_begin(&after_restart, &second_port);
    cut_drive(&second_port, CUT, LAST);
    cut_run(&after_restart);
    cut_assert_answered(&second_port, PLR_OK, "state restored: generation 1");
    cut_assert_same_poses();
}

static void test_who_asks_for_the_saved_state_on_another_clock_goes_on_there(void) {
    plr_message twist = drive_twist(0);
    cut_drive_and_save();
    cut_options.start = PLR_START_SAVED;
    twist.as.twist.t_ns = 5;
    cut_begin(&after_restart, &second_port);
    cut_send(&second_port, twist);
    cut_run(&after_restart);
    TEST_ASSERT_EQUAL_UINT32(0, after_restart.totals.refused);
    TEST_ASSERT_EQUAL_UINT64(5, plr_filter_time(&after_restart.filter));
    TEST_ASSERT_EQUAL_UINT(SLOTS, plr_filter_landmark_count(&after_restart.filter));
}

static void test_who_asks_for_the_saved_state_and_has_none_needs_a_start(void) {
    cut_options.start = PLR_START_SAVED;
    cut_begin(&after_restart, &second_port);
    cut_drive(&second_port, 0, 2);
    cut_run(&after_restart);
    cut_assert_answered(&second_port, PLR_E_NOT_READY, "nothing was ever saved");
    TEST_ASSERT_EQUAL_UINT32(3, after_restart.totals.refused); /* and both frames */
    cut_send(&second_port, drive_start(0.2));
    cut_drive(&second_port, 2, 3);
    cut_run(&after_restart);
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
    cut_options.output |= PLR_OUTPUT_ECHO;
    cut_drive_and_save();
    cut_begin(&after_restart, &second_port);
    cut_send(&second_port, cut_ask(PLR_STATE_RESTORE, 5));
    cut_run(&after_restart);
    TEST_ASSERT_TRUE(faulty_port_answer_of(&first_port, PLR_KIND_STATE, &message));
    TEST_ASSERT_EQUAL_UINT8(PLR_STATE_SAVE, message.as.state.action);
    TEST_ASSERT_TRUE(faulty_port_answer_of(&second_port, PLR_KIND_STATE, &message));
    TEST_ASSERT_EQUAL_UINT8(PLR_STATE_RESTORE, message.as.state.action);
}

static void test_the_log_of_a_restored_drive_gives_its_bits_where_the_state_is(void) {
    static faulty_port replay_port;
    static plr_session replay;
    cut_drive_and_save();
    cut_options.output |= PLR_OUTPUT_ECHO;
    cut_begin(&after_restart, &second_port);
    cut_send(&second_port, cut_ask(PLR_STATE_RESTORE, cut_frame_time(CUT - 1)));
    cut_drive(&second_port, CUT, LAST);
    cut_run(&after_restart);
    faulty_port_init(&replay_port, 4);
    const plr_port functions = faulty_port_functions(&replay_port);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(&replay, &functions, &cut_options));
    collect(&second_port, &replay_port);
    cut_run(&replay);
    TEST_ASSERT_EQUAL_UINT32(0, replay.totals.refused);
    replay.filter.map = after_restart.filter.map;
    TEST_ASSERT_TRUE(state_bytes_same_filter(&replay.filter, &after_restart.filter));
}
