// SPDX-License-Identifier: MIT
#include "support/session_desk.h"

#include <string.h>
#include <unity.h>

plr_session session;
plr_session_options options;
faulty_port port;
plr_status refused_status;
plr_kind refused_kind;
const plr_setting *refused_setting;

static void on_refused(void *context, plr_kind subject, plr_time_ns t_ns, plr_status status,
                       const plr_setting *culprit) {
    (void)context;
    (void)t_ns;
    if (refused_status != PLR_OK)
        return;
    refused_status = status;
    refused_kind = subject;
    refused_setting = culprit;
}

void desk_clear(uint64_t seed) {
    faulty_port_init(&port, seed);
    plr_session_options_default(&options);
    options.observer.refused = on_refused;
    refused_status = PLR_OK;
    refused_kind = PLR_KIND_NONE;
    refused_setting = NULL;
}

void desk_begin(void) {
    const plr_port functions = faulty_port_functions(&port);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(&session, &functions, &options));
}

void desk_begin_drive(void) {
    desk_begin();
    desk_send(drive_header());
}

void desk_send(plr_message message) {
    faulty_port_send(&port, &message);
}

void desk_send_frames(int first, int end) {
    for (int k = first; k < end; k++) {
        desk_send(drive_twist(0.1 * k));
        desk_send(drive_stereo(0.1 * k));
    }
}

void desk_run(void) {
    while (plr_session_step(&session) != PLR_STEP_CLOSED)
        continue;
}

plr_message desk_answer(plr_kind kind) {
    plr_message answer;
    TEST_ASSERT_TRUE(faulty_port_answer_of(&port, kind, &answer));
    return answer;
}

bool desk_next_refusal(plr_report_message *report) {
    plr_message answer;
    while (faulty_port_answer_of(&port, PLR_KIND_REPORT, &answer))
        if (answer.as.report.report.status != PLR_OK) {
            *report = answer.as.report;
            return true;
        }
    return false;
}

void desk_assert_refused(plr_kind subject, plr_status status) {
    plr_report_message report;
    TEST_ASSERT_TRUE(desk_next_refusal(&report));
    TEST_ASSERT_EQUAL_UINT8(subject, report.subject);
    TEST_ASSERT_EQUAL_INT(status, report.report.status);
}

void desk_assert_nothing_refused(void) {
    plr_report_message report;
    TEST_ASSERT_FALSE(desk_next_refusal(&report));
}

unsigned desk_texts_with(const char *words) {
    plr_message answer;
    unsigned n = 0;
    faulty_port_answers_again(&port);
    while (faulty_port_answer_of(&port, PLR_KIND_TEXT, &answer))
        n += strstr(answer.as.text.text, words) != NULL;
    faulty_port_answers_again(&port);
    return n;
}

void desk_use_setting(const char *name, double value) {
    static plr_wire_setting overrides[2];
    overrides[options.override_count].id = plr_setting_by_name(name)->id;
    overrides[options.override_count].value = value;
    options.overrides = overrides;
    options.override_count++;
}
