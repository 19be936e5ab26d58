// SPDX-License-Identifier: MIT
/* The phases of a session: which messages lead from one to another, and what each kind of message is
 * answered with in each of them. The expected table is that of docs/REPLAY-FORMAT.md, cell by cell. */
#include <stdio.h>
#include <unity.h>

#include "session/phase.h"
#include "support/cut_drive.h"
#include "support/wire_samples.h"

enum { KNOWN = 4 };

static plr_landmark known[KNOWN];

void setUp(void) {
    cut_clear();
}

/* --- the way into each phase --- */

static plr_message other_header(void) {
    plr_message header = drive_header();
    header.as.header.calibration.fx_px += 1;
    return header;
}

static plr_message end_message(void) {
    return (plr_message){.kind = PLR_KIND_END};
}

static void send(plr_message message) {
    cut_send(&second_port, message);
    cut_run(&after_restart);
}

/* A session in that phase, with a store that holds a state. */
static void lead_to(plr_session_phase phase) {
    setUp();
    cut_drive_and_save();
    const plr_port functions = faulty_port_functions(&second_port);
    cut_options.start = PLR_START_RECORDED;
    cut_options.known = known;
    cut_options.known_capacity = KNOWN;
    cut_options.output |= PLR_OUTPUT_ECHO;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_session_init(&after_restart, &functions, &cut_options));
    send(drive_header()); /* an earlier drive, of which nothing may count */
    send(drive_start(0));
    send(drive_stereo(0));
    send(end_message());
    if (phase == PLR_PHASE_WAITING)
        return;
    send(drive_header());
    send(drive_config("slots", SLOTS));
    if (phase == PLR_PHASE_REJECTED)
        send(drive_config("landmark-sigma", 1)); /* body takes it from the pixels */
    if (phase == PLR_PHASE_RESTORED)
        send(cut_ask(PLR_STATE_RESTORE, drive_time_ns(0)));
    if (phase == PLR_PHASE_STARTING || phase == PLR_PHASE_REJECTED || phase == PLR_PHASE_RUNNING)
        send(drive_twist(0));
    if (phase == PLR_PHASE_RUNNING)
        send(drive_start(0.05));
    if (phase == PLR_PHASE_RUNNING)
        send(drive_stereo(0.1));
    TEST_ASSERT_EQUAL_INT(phase, after_restart.phase);
}

/* --- the table --- */

/* What the session does with a message, as it shows from outside. */
typedef struct outcome {
    plr_status refused;      /* PLR_OK: it is not */
    plr_session_phase after; /* the phase that it leaves */
} outcome;

#define WAITING  PLR_PHASE_WAITING
#define READY    PLR_PHASE_READY
#define REJECTED PLR_PHASE_REJECTED
#define STARTING PLR_PHASE_STARTING
#define RESTORED PLR_PHASE_RESTORED
#define RUNNING  PLR_PHASE_RUNNING
#define EARLY    PLR_E_NOT_READY
#define LATE     PLR_E_MODE
#define NO_TWIST PLR_E_TIME
#define CONFIG   PLR_E_CONFIG
#define OK       PLR_OK

/* clang-format off */
static const struct {
    const char *what;
    outcome in[PLR_PHASES]; /* in the order of the phases */
} expected[] = {
    {"HEADER, the same", {{OK, READY}, {OK, READY}, {OK, REJECTED}, {OK, STARTING}, {OK, RESTORED}, {OK, RUNNING}}},
    {"HEADER, another", {{OK, READY}, {OK, READY}, {OK, READY}, {LATE, STARTING}, {LATE, RESTORED}, {LATE, RUNNING}}},
    {"CONFIG, the same", {{EARLY, WAITING}, {OK, READY}, {OK, READY}, {OK, STARTING}, {OK, RESTORED}, {OK, RUNNING}}},
    {"CONFIG, another", {{EARLY, WAITING}, {OK, READY}, {OK, READY}, {LATE, STARTING}, {LATE, RESTORED}, {LATE, RUNNING}}},
    {"START", {{EARLY, WAITING}, {OK, READY}, {OK, REJECTED}, {OK, STARTING}, {OK, RESTORED}, {OK, RUNNING}}},
    {"LANDMARK", {{EARLY, WAITING}, {OK, READY}, {OK, REJECTED}, {OK, STARTING}, {OK, RESTORED}, {OK, RUNNING}}},
    {"LANDMARK, evicted", {{OK, WAITING}, {OK, READY}, {OK, REJECTED}, {OK, STARTING}, {OK, RESTORED}, {OK, RUNNING}}},
    {"STATE, restore", {{EARLY, WAITING}, {OK, RESTORED}, {CONFIG, REJECTED}, {LATE, STARTING}, {OK, RESTORED}, {LATE, RUNNING}}},
    {"STATE, save", {{EARLY, WAITING}, {EARLY, READY}, {EARLY, REJECTED}, {OK, STARTING}, {OK, RESTORED}, {OK, RUNNING}}},
    {"TWIST", {{EARLY, WAITING}, {OK, STARTING}, {EARLY, REJECTED}, {OK, STARTING}, {OK, RUNNING}, {OK, RUNNING}}},
    {"STEREO", {{EARLY, WAITING}, {EARLY, STARTING}, {EARLY, REJECTED}, {EARLY, STARTING}, {OK, RUNNING}, {OK, RUNNING}}},
    {"TRUTH", {{OK, WAITING}, {OK, STARTING}, {OK, REJECTED}, {OK, STARTING}, {OK, RUNNING}, {OK, RUNNING}}},
    {"READING", {{EARLY, WAITING}, {NO_TWIST, STARTING}, {EARLY, REJECTED}, {OK, STARTING}, {NO_TWIST, RUNNING}, {OK, RUNNING}}},
    {"IMU, with process = twist", {{EARLY, WAITING}, {LATE, STARTING}, {EARLY, REJECTED}, {LATE, STARTING}, {LATE, RUNNING}, {LATE, RUNNING}}},
    {"IMAGE, without eyes", {{EARLY, WAITING}, {LATE, STARTING}, {EARLY, REJECTED}, {LATE, STARTING}, {LATE, RUNNING}, {LATE, RUNNING}}},
    {"RIG, without eyes", {{EARLY, WAITING}, {OK, READY}, {OK, REJECTED}, {OK, STARTING}, {OK, RESTORED}, {OK, RUNNING}}},
    {"TEXT", {{OK, WAITING}, {OK, READY}, {OK, REJECTED}, {OK, STARTING}, {OK, RESTORED}, {OK, RUNNING}}},
    {"POSE", {{OK, WAITING}, {OK, READY}, {OK, REJECTED}, {OK, STARTING}, {OK, RESTORED}, {OK, RUNNING}}},
    {"END", {{OK, WAITING}, {OK, WAITING}, {OK, WAITING}, {OK, WAITING}, {OK, WAITING}, {OK, WAITING}}},
};
/* clang-format on */

static plr_message message_of(unsigned row) {
    plr_message message = {.kind = PLR_KIND_TEXT};
    switch (row) {
    case 0:
        return drive_header();
    case 1:
        return other_header();
    case 2:
        return drive_config("landmark-sigma", 0);
    case 3:
        return drive_config("slots", SLOTS - 1);
    case 4:
        return drive_start(1);
    case 5:
        return drive_known(1, 0.1);
    case 6:
        message = drive_known(1, 0.1);
        message.as.landmark.role = PLR_LANDMARK_EVICTED;
        return message;
    case 7:
        return cut_ask(PLR_STATE_RESTORE, drive_time_ns(0));
    case 8:
        return cut_ask(PLR_STATE_SAVE, 0);
    case 9:
        return drive_twist(0.2);
    case 10:
        return drive_stereo(0.2);
    case 11:
        return drive_truth(0.2);
    case 12:
        message.kind = PLR_KIND_READING;
        message.as.reading = (plr_reading){.t_ns = drive_time_ns(0.2),
                                           .sensor = PLR_SENSOR_STANDSTILL,
                                           .axes = 3,
                                           .sigma = {0.01, 0.01, 0.01}};
        return message;
    case 13:
        return drive_imu(0.2, 1, 0);
    case 14:
        return wire_sample(PLR_KIND_IMAGE, WIRE_SAMPLE_LEAST);
    case 15:
        return wire_sample(PLR_KIND_RIG, WIRE_SAMPLE_COMMON);
    case 17:
        message.kind = PLR_KIND_POSE;
        message.as.pose.real_bytes = 8;
        return message;
    case 18:
        return end_message();
    default:
        return message;
    }
}

/* The last refusal, of whatever kind. */
static plr_status last_refusal;

static void on_refused(void *context, plr_kind subject, plr_time_ns t_ns, plr_status status,
                       const plr_setting *culprit) {
    (void)context;
    (void)subject;
    (void)t_ns;
    (void)culprit;
    last_refusal = status;
}

static void test_each_kind_in_each_phase_is_answered_as_the_table_says(void) {
    for (unsigned row = 0; row < sizeof expected / sizeof expected[0]; row++)
        for (unsigned phase = 0; phase < PLR_PHASES; phase++) {
            const outcome *out = &expected[row].in[phase];
            char where[64];
            lead_to((plr_session_phase)phase);
            after_restart.options.observer.refused = on_refused;
            last_refusal = PLR_OK;
            send(message_of(row));
            snprintf(where, sizeof where, "%s in phase %u", expected[row].what, phase);
            TEST_ASSERT_EQUAL_INT_MESSAGE(out->refused, last_refusal, where);
            TEST_ASSERT_EQUAL_INT_MESSAGE(out->after, after_restart.phase, where);
        }
}

/* --- what a phase means --- */

static void test_a_start_sets_the_pose_once_its_time_has_come(void) {
    lead_to(PLR_PHASE_STARTING);
    send(drive_start(0.5));
    TEST_ASSERT_EQUAL_INT(PLR_PHASE_STARTING, after_restart.phase);
    TEST_ASSERT_TRUE(after_restart.start_pending);
    send(drive_twist(0.6));
    TEST_ASSERT_EQUAL_INT(PLR_PHASE_RUNNING, after_restart.phase);
    TEST_ASSERT_FALSE(after_restart.start_pending);
}

static void test_a_restore_that_fails_leads_back_to_ready(void) {
    lead_to(PLR_PHASE_RESTORED);
    cut_flash.bytes[100] ^= 4;
    send(cut_ask(PLR_STATE_RESTORE, drive_time_ns(0)));
    TEST_ASSERT_EQUAL_INT(PLR_PHASE_READY, after_restart.phase);
}

/* Phases, as numbers, that each event leads to; whatever is not drawn stays where it is. */
static void test_an_event_that_leads_nowhere_changes_nothing(void) {
    static const struct {
        plr_session_phase from;
        plr_phase_trigger event;
        plr_session_phase to;
    } arrows[] = {
        {WAITING, PLR_TRIGGER_HEADER, READY},    {REJECTED, PLR_TRIGGER_HEADER, READY},
        {REJECTED, PLR_TRIGGER_SETTINGS, READY}, {READY, PLR_TRIGGER_REJECTED, REJECTED},
        {READY, PLR_TRIGGER_FILTER, STARTING},   {STARTING, PLR_TRIGGER_POSE, RUNNING},
        {READY, PLR_TRIGGER_RESTORED, RESTORED}, {RESTORED, PLR_TRIGGER_RESTORE, READY},
        {RESTORED, PLR_TRIGGER_DATA, RUNNING},
    };
    for (unsigned from = 0; from < PLR_PHASES; from++)
        for (unsigned event = 0; event <= PLR_TRIGGER_END; event++) {
            unsigned to = event == PLR_TRIGGER_END ? WAITING : from;
            for (unsigned i = 0; i < sizeof arrows / sizeof arrows[0]; i++)
                if (arrows[i].from == from && arrows[i].event == event)
                    to = arrows[i].to;
            plr_session_phase phase = (plr_session_phase)from;
            plr_phase_change(&phase, (plr_phase_trigger)event);
            TEST_ASSERT_EQUAL_INT(to, phase);
        }
}

/* --- what is echoed --- */

/* Frames of that kind among the answers. */
static unsigned answers_of(plr_kind kind) {
    plr_message answer;
    unsigned n = 0;
    faulty_port_answers_again(&second_port);
    while (faulty_port_answer_of(&second_port, kind, &answer))
        n++;
    return n;
}

static void test_a_message_is_echoed_whether_it_is_used_or_refused(void) {
    static const struct {
        unsigned row;
        plr_kind kind;
        unsigned echoes; /* what other filters computed has none */
    } tried[] = {
        {1, PLR_KIND_HEADER, 1},   {3, PLR_KIND_CONFIG, 1},   {4, PLR_KIND_START, 1},
        {5, PLR_KIND_LANDMARK, 1}, {6, PLR_KIND_LANDMARK, 0}, {7, PLR_KIND_STATE, 1},
        {8, PLR_KIND_STATE, 1},    {9, PLR_KIND_TWIST, 1},    {10, PLR_KIND_STEREO, 1},
        {11, PLR_KIND_TRUTH, 1},   {12, PLR_KIND_READING, 1}, {13, PLR_KIND_IMU, 1},
        {14, PLR_KIND_IMAGE, 0},   {15, PLR_KIND_RIG, 1},     {16, PLR_KIND_TEXT, 1},
        {17, PLR_KIND_POSE, 0},
    };
    for (unsigned i = 0; i < sizeof tried / sizeof tried[0]; i++)
        for (unsigned phase = 0; phase < PLR_PHASES; phase++) {
            lead_to((plr_session_phase)phase);
            const unsigned before = answers_of(tried[i].kind);
            send(message_of(tried[i].row));
            TEST_ASSERT_EQUAL_UINT_MESSAGE(before + tried[i].echoes, answers_of(tried[i].kind),
                                           expected[tried[i].row].what);
        }
}
