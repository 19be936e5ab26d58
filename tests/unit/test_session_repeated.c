// SPDX-License-Identifier: MIT
/* A frame that comes twice: used twice, its pixels would count for more than they know. */
#include <string.h>
#include <unity.h>

#include "pelorus/session.h"
#include "support/faulty_port.h"
#include "support/session_drive.h"

static plr_session session, once;
static plr_session_options options;
static faulty_port port, other;

static unsigned observed, observed_refused;

static void observe_frame(void *context, const plr_frame_result *result) {
    (void)context;
    observed++;
    if (result->report->status == PLR_E_TIME && result->pose == NULL)
        observed_refused++;
}

void setUp(void) {
    faulty_port_init(&port, 1);
    faulty_port_init(&other, 1);
    plr_session_options_default(&options);
    observed = observed_refused = 0;
}

/* Five frames, each sent so many times. */
static void drive(plr_session *s, faulty_port *p, int times) {
    const plr_port functions = faulty_port_functions(p);
    plr_message message = drive_header();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(s, &functions, &options));
    faulty_port_send(p, &message);
    for (int k = 0; k < 5; k++) {
        message = drive_twist(0.1 * k);
        faulty_port_send(p, &message);
        message = drive_stereo(0.1 * k);
        for (int n = 0; n < times; n++)
            faulty_port_send(p, &message);
    }
    while (plr_session_step(s) != PLR_STEP_CLOSED)
        continue;
}

static void test_it_is_refused_and_changes_no_bit(void) {
    drive(&session, &port, 3);
    drive(&once, &other, 1);
    TEST_ASSERT_EQUAL_MEMORY(&once.filter.belief.slots, &session.filter.belief.slots,
                             sizeof once.filter.belief.slots);
    TEST_ASSERT_EQUAL_MEMORY(&once.filter.belief.P, &session.filter.belief.P,
                             sizeof once.filter.belief.P);
    TEST_ASSERT_EQUAL_MEMORY(&once.filter.belief.p_WB, &session.filter.belief.p_WB,
                             sizeof once.filter.belief.p_WB);
    TEST_ASSERT_EQUAL_MEMORY(&once.filter.belief.R_WB, &session.filter.belief.R_WB,
                             sizeof once.filter.belief.R_WB);
    TEST_ASSERT_EQUAL_UINT32(5, session.filter.totals.frames);
    TEST_ASSERT_EQUAL_UINT32(10, session.totals.refused);
    TEST_ASSERT_EQUAL_INT(PLR_OK, session.last.status);
}

static void test_each_is_answered_with_a_report_that_says_why_and_no_pose(void) {
    plr_message answer;
    unsigned poses = 0, good = 0, refused = 0;
    options.observer.frame = observe_frame;
    drive(&session, &port, 2);
    while (faulty_port_answer(&port, &answer)) {
        poses += answer.kind == PLR_KIND_POSE;
        if (answer.kind != PLR_KIND_REPORT)
            continue;
        TEST_ASSERT_EQUAL_UINT8(PLR_KIND_STEREO, answer.as.report.subject);
        good += answer.as.report.report.status == PLR_OK;
        refused += answer.as.report.report.status == PLR_E_TIME;
    }
    TEST_ASSERT_EQUAL_UINT(5, poses);
    TEST_ASSERT_EQUAL_UINT(5, good);
    TEST_ASSERT_EQUAL_UINT(5, refused);
    TEST_ASSERT_EQUAL_UINT(10, observed);
    TEST_ASSERT_EQUAL_UINT(5, observed_refused);
}

/* Nothing has a last time yet: no time can repeat it, not even that of an untouched memory. */
static void test_a_first_frame_at_time_zero_is_taken(void) {
    const plr_port functions = faulty_port_functions(&port);
    plr_message message = drive_header();
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(&session, &functions, &options));
    faulty_port_send(&port, &message);
    message = drive_stereo(0);
    message.as.stereo.t_ns = 0;
    faulty_port_send(&port, &message);
    while (plr_session_step(&session) != PLR_STEP_CLOSED)
        continue;
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.refused);
    TEST_ASSERT_TRUE(session.last.created > 3);
}

static void test_the_same_drive_after_its_end_repeats_nothing(void) {
    plr_message end;
    memset(&end, 0, sizeof end);
    end.kind = PLR_KIND_END;
    drive(&session, &port, 1);
    faulty_port_send(&port, &end);
    const plr_message header = drive_header(), stereo = drive_stereo(0.4);
    faulty_port_send(&port, &header);
    faulty_port_send(&port, &stereo);
    while (plr_session_step(&session) != PLR_STEP_CLOSED)
        continue;
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.refused);
    TEST_ASSERT_EQUAL_UINT64(drive_time_ns(0.4), session.last.t_ns);
}
