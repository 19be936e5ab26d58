// SPDX-License-Identifier: MIT
/* A robot is switched off in the middle of its drive: the session after the restart goes on where the
 * one before it was when it saved. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "pelorus/session.h"
#include "pelorus/state_store.h"
#include "support/faulty_flash.h"
#include "support/faulty_port.h"
#include "support/pose_of.h"
#include "support/session_drive.h"
#include "support/state_bytes.h"

enum { SLOTS = 8, ERASE = 1024, PROGRAM = 16 };

static plr_session before_cut, after_restart;
static plr_session_options options;
static faulty_port first_port, second_port;
static faulty_flash flash;
static plr_state_store store;
static plr_time_ns resume_ns; /* 0: the clock goes on */
static plr_status restored;

void setUp(void) {
    faulty_port_init(&first_port, 1);
    faulty_port_init(&second_port, 2);
    faulty_flash_init(&flash, 3, FAULTY_FLASH_BYTES, ERASE, PROGRAM);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_state_store_init(&store, &flash.device));
    plr_session_options_default(&options);
    resume_ns = 0;
    restored = PLR_E_NOT_READY;
}

void tearDown(void) {
    TEST_ASSERT_EQUAL_UINT(0, flash.violations);
}

static void on_started(void *context) {
    plr_session *s = context;
    restored = plr_state_store_restore(&store, &s->filter, NULL);
    if (restored == PLR_OK && resume_ns > 0)
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_resume(&s->filter, resume_ns, NULL));
}

static void begin(plr_session *s, faulty_port *port, bool restores) {
    const plr_port functions = faulty_port_functions(port);
    const plr_message header = drive_header(), slots = drive_config("slots", SLOTS);
    options.observer.context = s;
    options.observer.started = restores ? on_started : NULL;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(s, &functions, &options));
    faulty_port_send(port, &header);
    faulty_port_send(port, &slots);
}

/* Sends the drive from frame to frame, ten a second, with a shifted clock. */
static void drive(plr_session *s, faulty_port *port, unsigned from, unsigned to,
                  plr_time_ns later_ns) {
    for (unsigned i = from; i < to; i++) {
        for (unsigned k = 0; k < 4; k++) {
            plr_message twist = drive_twist(0.1 * i + 0.025 * k);
            twist.as.twist.t_ns += later_ns;
            faulty_port_send(port, &twist);
        }
        plr_message stereo = drive_stereo(0.1 * i + 0.09);
        stereo.as.stereo.t_ns += later_ns;
        faulty_port_send(port, &stereo);
    }
    while (plr_session_step(s) != PLR_STEP_CLOSED)
        continue;
    TEST_ASSERT_EQUAL_UINT(0, s->totals.refused);
}

static void drive_save_and_restart(void) {
    begin(&before_cut, &first_port, false);
    drive(&before_cut, &first_port, 0, 12, 0);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_state_store_save(&store, &before_cut.filter, NULL));
    TEST_ASSERT_EQUAL_UINT(SLOTS, plr_filter_landmark_count(&before_cut.filter));
    begin(&after_restart, &second_port, true);
}

static void test_a_session_goes_on_with_the_bits_of_the_one_before_it(void) {
    drive_save_and_restart();
    drive(&before_cut, &first_port, 12, 24, 0);
    drive(&after_restart, &second_port, 12, 24, 0);
    TEST_ASSERT_EQUAL_INT(PLR_OK, restored);
    before_cut.filter.map = after_restart.filter.map; /* each has its own session as context */
    TEST_ASSERT_TRUE(state_bytes_same_filter(&before_cut.filter, &after_restart.filter));
}

static void test_on_a_clock_that_began_anew_the_drive_is_the_same_to_two_centimetres(void) {
    plr_pose a;
    const plr_time_ns hour = UINT64_C(3600000000000);
    drive_save_and_restart();
    /* a hundredth of a second is lost between the last frame and the first twist */
    resume_ns = drive_time_ns(1.2) + hour;
    drive(&before_cut, &first_port, 12, 24, 0);
    drive(&after_restart, &second_port, 12, 24, hour);
    TEST_ASSERT_EQUAL_INT(PLR_OK, restored);
    TEST_ASSERT_EQUAL_UINT32(0, after_restart.totals.reanchored);
    a = pose_of(&before_cut.filter);
    const plr_pose b = pose_of(&after_restart.filter);
    for (unsigned i = 0; i < 3; i++)
        TEST_ASSERT_DOUBLE_WITHIN(0.02, a.p[i], b.p[i]);
}

static void test_without_a_saved_state_the_session_begins_as_ever(void) {
    begin(&after_restart, &second_port, true);
    drive(&after_restart, &second_port, 0, 12, 0);
    TEST_ASSERT_EQUAL_INT(PLR_E_NOT_READY, restored);
    begin(&before_cut, &first_port, false);
    drive(&before_cut, &first_port, 0, 12, 0);
    before_cut.filter.map = after_restart.filter.map;
    TEST_ASSERT_TRUE(state_bytes_same_filter(&before_cut.filter, &after_restart.filter));
}
