// SPDX-License-Identifier: MIT
/*
 * The committed recordings through the filter, against the committed results: the same bits from
 * every compiler, level of optimisation and processor. docs/TESTING.md says how they are
 * renewed when a change is meant.
 *
 * A line of the results is a frame: counts and position in full, everything else as a CRC-32 of its
 * bytes.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "pelorus/filter.h"
#include "pelorus/wire.h"
#include "state/covariance.h"
#include "support/axes.h"

enum { BUFFER = PLR_WIRE_STEREO_BODY(256), LINE = 320, MOST_KNOWN = 200 };

typedef struct scenario {
    const char *name;
    plr_model_kind model;
    plr_mode mode;
    bool bias;
    unsigned slots;
    double max_depth_m;
    bool slips;          /* the wheels slip: from 3 to 6 s twists are half of what they were */
    plr_imu_start start; /* of the recording of an IMU; AUTO: that of twists */
    unsigned calibrate;  /* the setting */
} scenario;

static const scenario scenarios[] = {
    {"body", PLR_MODEL_BODY, PLR_MODE_SLAM, true, 25, 0, false, PLR_IMU_START_AUTO, 0},
    {"world", PLR_MODEL_WORLD, PLR_MODE_SLAM, false, 20, 20, false, PLR_IMU_START_AUTO, 0},
    {"localization", PLR_MODEL_BODY, PLR_MODE_LOCALIZATION, true, 25, 0, false, PLR_IMU_START_AUTO,
     0},
    {"mapping", PLR_MODEL_BODY, PLR_MODE_MAPPING, false, 25, 0, false, PLR_IMU_START_AUTO, 0},
    {"slip", PLR_MODEL_BODY, PLR_MODE_SLAM, true, 25, 0, true, PLR_IMU_START_AUTO, 0},
    {"imu-rest", PLR_MODEL_BODY, PLR_MODE_SLAM, true, 25, 0, false, PLR_IMU_START_REST, 0},
    {"imu-motion", PLR_MODEL_BODY, PLR_MODE_SLAM, true, 25, 0, false, PLR_IMU_START_MOTION, 0},
    {"calibrated", PLR_MODEL_BODY, PLR_MODE_SLAM, true, 25, 0, false, PLR_IMU_START_REST,
     PLR_CALIBRATE_FOCAL | PLR_CALIBRATE_TURN | PLR_CALIBRATE_CENTRE | PLR_CALIBRATE_PLACE |
         PLR_CALIBRATE_CLOCK},
};

static bool is_by_imu(const scenario *s) {
    return s->start != PLR_IMU_START_AUTO;
}

static plr_filter filter;
static plr_landmark known[MOST_KNOWN];
static unsigned known_count;
static FILE *expected; /* NULL while results are renewed */
static FILE *renewed;
static unsigned line_number;

void setUp(void) {
    known_count = line_number = 0;
    expected = renewed = NULL;
}

void tearDown(void) {
    if (expected)
        fclose(expected);
    if (renewed)
        fclose(renewed);
}

/* ---------------------------------------------------------------- a line a frame */

static uint32_t crc(const void *bytes, size_t n) {
    return plr_crc32(0, bytes, n);
}

static uint32_t crc_of_landmarks(void) {
    uint32_t sum = 0;
    for (unsigned slot = 0; slot < filter.belief.count; slot++) {
        sum = plr_crc32(sum, (const uint8_t *)&filter.belief.slots[slot].id, sizeof(uint32_t));
        sum = plr_crc32(sum, (const uint8_t *)filter.belief.slots[slot].x,
                        sizeof filter.belief.slots[slot].x);
    }
    return sum;
}

/* Of the biases; with an IMU of velocity and rate too, and of their covariance. */
static uint32_t crc_of_bias(void) {
    plr_twist now;
    double P_u[36];
    const uint32_t sum = crc(filter.belief.bias, sizeof filter.belief.bias);
    if (plr_filter_config(&filter)->process != PLR_PROCESS_IMU)
        return sum;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity(&filter, &now));
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_velocity_covariance(&filter, P_u));
    return plr_crc32(plr_crc32(sum, (const uint8_t *)&now, sizeof now), (const uint8_t *)P_u,
                     sizeof P_u);
}

static uint32_t crc_of_sensitivity(void) {
    const unsigned n = plr_covariance_dim(&filter.belief);
    uint32_t sum = 0;
    for (unsigned k = 0; k < filter.camera.errors.count; k++)
        sum = plr_crc32(sum, (const uint8_t *)filter.belief.S[k], n * sizeof *filter.belief.S[k]);
    if (filter.camera.errors.estimated > 0)
        sum = plr_crc32(sum, (const uint8_t *)&filter.camera.estimate.eye,
                        sizeof filter.camera.estimate.eye);
    return sum;
}

static void describe(char line[LINE], const plr_report *r) {
    plr_real P_xi[36];
    const unsigned n = plr_covariance_dim(&filter.belief);
    plr_covariance_get(&filter.belief, PLR_BLOCK_POSE, PLR_BLOCK_POSE, P_xi);
    snprintf(line, LINE,
             "t %.9f p %.17g %.17g %.17g R %08x P_xi %08x bias %08x landmarks %08x P %08x S %08x "
             "used %u gated %u new %u evicted %u active %u status %d",
             (double)r->t_ns * 1e-9, filter.belief.p_WB[0], filter.belief.p_WB[1],
             filter.belief.p_WB[2], crc(filter.belief.R_WB, sizeof filter.belief.R_WB),
             crc(P_xi, sizeof P_xi), crc_of_bias(), crc_of_landmarks(),
             crc(filter.belief.P, n * (n + 1) / 2 * sizeof *filter.belief.P), crc_of_sensitivity(),
             r->used, r->gated, r->created, r->evicted, r->active, r->status);
}

/* Says which words of two lines differ, each behind the name that stands before it. */
static void print_differences(const char *due, const char *got) {
    char name[32] = "";
    while (*due || *got) {
        const int due_length = (int)strcspn(due, " "), got_length = (int)strcspn(got, " ");
        const bool same = due_length == got_length && memcmp(due, got, (size_t)due_length) == 0;
        if (same && (*due >= 'A'))
            snprintf(name, sizeof name, "%.*s", due_length, due);
        if (!same)
            printf("  %-9s due %.*s, got %.*s\n", name, due_length, due, got_length, got);
        due += due_length + (due[due_length] == ' ');
        got += got_length + (got[got_length] == ' ');
    }
}

static void compare(const char *line) {
    char due[LINE];
    line_number++;
    if (renewed) {
        fprintf(renewed, "%s\n", line);
        return;
    }
    if (!fgets(due, sizeof due, expected))
        due[0] = '\0';
    due[strcspn(due, "\n")] = '\0';
    if (strcmp(line, due) == 0)
        return;
    printf("frame %u, t %.9f s, is the first that differs:\n", line_number,
           (double)plr_filter_time(&filter) * 1e-9);
    print_differences(due, line);
    printf("  R is now ");
    for (int i = 0; i < 9; i++)
        printf("%.9g%s", (double)filter.belief.R_WB[i], i < 8 ? " " : "\n");
    TEST_FAIL_MESSAGE("other bits; if the change is meant: docs/TESTING.md, \"The golden replay\"");
}

/* ---------------------------------------------------------------- the recording */

static bool source(void *context, uint32_t id, plr_landmark *landmark) {
    (void)context;
    for (unsigned i = 0; i < known_count; i++)
        if (known[i].id == id) {
            *landmark = known[i];
            return true;
        }
    return false;
}

static void suggest_for_twists(plr_config *config, const plr_header *header) {
    each_axis(config->velocity_sigma, header->velocity_sigma_mps);
    each_axis(config->gyro_sigma, header->gyro_sigma_radps);
    config->bias_velocity_sigma_mps = header->bias_velocity_sigma_mps;
    config->bias_gyro_sigma_radps = header->bias_gyro_sigma_radps;
    config->bias_velocity_walk = header->bias_velocity_walk;
    config->bias_gyro_walk = header->bias_gyro_walk;
}

static void suggest_for_imu(plr_config *config, const scenario *s, const plr_header *header) {
    config->process = PLR_PROCESS_IMU;
    config->imu_start = (uint8_t)s->start;
    config->gyro_noise = header->gyro_noise;
    config->accel_noise = header->accel_noise;
    config->gyro_walk = header->gyro_walk;
    config->accel_walk = header->accel_walk;
    config->bias_accel_sigma_mps2 = header->bias_accel_sigma_mps2;
    config->bias_gyro_sigma_radps = header->bias_gyro_sigma_radps;
    config->gravity_mps2 = header->gravity_mps2;
}

static void begin(const scenario *s, const plr_header *header) {
    const plr_map map = {.source = source};
    plr_config config;
    plr_config_default(&config);
    config.model = (uint8_t)s->model;
    config.mode = (uint8_t)s->mode;
    config.bias = s->bias;
    config.slots = (uint16_t)s->slots;
    config.max_depth_m = s->max_depth_m;
    config.twist_timing = header->twist_timing;
    config.pixel_sigma_px = header->pixel_sigma_px;
    config.calibrate = (uint8_t)s->calibrate;
    if (s->calibrate != 0) { /* the baseline is considered */
        config.centre_sigma_px = 1;
        config.camera_place_sigma_m = 0.01;
        config.camera_clock_sigma_s = 0.003;
    }
    if (is_by_imu(s))
        suggest_for_imu(&config, s, header);
    else
        suggest_for_twists(&config, header);
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&filter, &header->calibration, &config, &map));
}

static void take_truth(const scenario *s, const plr_truth *truth) {
    double P[36] = {0};
    for (int i = 0; i < 6; i++)
        P[7 * i] = 1e-8;
    if (s->mode == PLR_MODE_MAPPING)
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_move_to(&filter, truth->t_ns, &truth->T_WB));
    else if (filter.totals.frames == 0)
        TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&filter, truth->t_ns, &truth->T_WB, P));
}

static void take_twist(const scenario *s, const plr_twist_message *message) {
    plr_twist twist = message->twist;
    const double t_s = (double)message->t_ns * 1e-9;
    for (int i = 0; i < 3 && s->slips && t_s >= 3 && t_s < 6; i++)
        twist.v_B_mps[i] *= 0.5;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_predict(&filter, message->t_ns, &twist));
}

static void take_start(const plr_start *start) {
    double P[36];
    for (unsigned i = 0, k = 0; i < 6; i++)
        for (unsigned j = 0; j <= i; j++, k++)
            P[6 * i + j] = P[6 * j + i] = start->P_xi[k];
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_set_pose(&filter, start->t_ns, &start->T_WB, P));
}

static void take_imu(const plr_imu_message *imu) {
    for (unsigned i = 0; i < imu->count; i++)
        TEST_ASSERT_EQUAL_INT(
            PLR_OK, plr_filter_inertial(&filter, imu->t_ns + i * (plr_time_ns)imu->period_ns,
                                        &imu->readings[i]));
}

static void take(const scenario *s, const plr_message *message) {
    char line[LINE];
    plr_report report;
    switch (message->kind) {
    case PLR_KIND_HEADER:
        begin(s, &message->as.header);
        break;
    case PLR_KIND_LANDMARK:
        TEST_ASSERT_LESS_THAN_UINT(MOST_KNOWN, known_count);
        known[known_count++] = message->as.landmark.landmark;
        break;
    case PLR_KIND_TRUTH:
        if (!is_by_imu(s))
            take_truth(s, &message->as.truth);
        break;
    case PLR_KIND_START:
        if (is_by_imu(s))
            take_start(&message->as.start);
        break;
    case PLR_KIND_IMU:
        take_imu(&message->as.imu);
        break;
    case PLR_KIND_READING:
        (void)plr_filter_measure(&filter, &message->as.reading,
                                 NULL); /* refused before the start */
        break;
    case PLR_KIND_TWIST:
        take_twist(s, &message->as.twist);
        break;
    case PLR_KIND_STEREO:
        (void)plr_filter_update(&filter, &message->as.stereo, &report);
        describe(line, &report);
        compare(line);
        break;
    default:
        break;
    }
}

static void replay(const scenario *s) {
    static uint8_t buffer[BUFFER];
    static plr_observation observations[256];
    plr_reader reader;
    uint8_t bytes[512];
    size_t n;
    const char *path = is_by_imu(s) ? PELORUS_SOURCE_DIR "/tests/golden/imu.plr"
                                    : PELORUS_SOURCE_DIR "/tests/golden/drive.plr";
    FILE *recording = fopen(path, "rb");
    TEST_ASSERT_NOT_NULL_MESSAGE(recording, path);
    TEST_ASSERT_EQUAL_INT(PLR_OK,
                          plr_reader_init(&reader, buffer, sizeof buffer, observations, 256));
    while ((n = fread(bytes, 1, sizeof bytes, recording)) > 0)
        for (size_t at = 0, taken; at < n; at += taken) {
            plr_message message;
            if (plr_reader_feed(&reader, bytes + at, n - at, &taken, &message) == PLR_READ_MESSAGE)
                take(s, &message);
        }
    fclose(recording);
    TEST_ASSERT_EQUAL_UINT32(0, reader.counts.damaged + reader.counts.missing);
}

/* ---------------------------------------------------------------- tests */

/* The first line of the results: the arithmetic that they are of. */
static void check_number(const char *line) {
    int number = 0;
    TEST_ASSERT_EQUAL_INT_MESSAGE(1, sscanf(line, "arithmetic %d", &number), "first line");
    TEST_ASSERT_EQUAL_INT_MESSAGE(PLR_ARITHMETIC, number, "results of another PLR_ARITHMETIC");
}

/* Other results under the same number would tell a log's reader that nothing has changed. */
static void check_renewal(const scenario *s, const char *path) {
    char committed[1024], due[LINE] = "", got[LINE] = "";
    snprintf(committed, sizeof committed, PELORUS_SOURCE_DIR "/tests/golden/%s.f%d.txt", s->name,
             PLR_REAL);
    FILE *before = fopen(committed, "r"), *after = fopen(path, "r");
    TEST_ASSERT_TRUE(before && after);
    const bool same_number =
        fgets(due, LINE, before) && fgets(got, LINE, after) && strcmp(due, got) == 0;
    bool same = true;
    while (same && fgets(due, LINE, before) && fgets(got, LINE, after))
        same = strcmp(due, got) == 0;
    fclose(before);
    fclose(after);
    if (same_number && !same)
        TEST_FAIL_MESSAGE("other results under the same number: raise PLR_ARITHMETIC first");
}

/* Where results are written to, if they are to be renewed. */
static const char *renewal_folder(void) {
    return getenv("PELORUS_GOLDEN_RENEW");
}

static void check(const scenario *s) {
    char path[1024], line[LINE];
    const char *folder = renewal_folder();
    if (PLR_BLOCK_OBSERVATIONS != 8 || PLR_MAX_LANDMARKS < 25 ||
        (s->calibrate != 0 && PLR_MAX_CALIBRATION < 11))
        TEST_IGNORE_MESSAGE("the bits of this build's blocks or capacity are others");
    snprintf(path, sizeof path, "%s/%s.f%d.txt",
             folder ? folder : PELORUS_SOURCE_DIR "/tests/golden", s->name, PLR_REAL);
    FILE *file = fopen(path, folder ? "w" : "r");
    TEST_ASSERT_NOT_NULL_MESSAGE(file, path);
    if (folder)
        renewed = file;
    else
        expected = file;
    if (renewed)
        fprintf(renewed, "arithmetic %d\n", PLR_ARITHMETIC);
    else
        check_number(fgets(line, sizeof line, expected) ? line : "");
    replay(s);
    TEST_ASSERT_GREATER_THAN_UINT(50, line_number);
    if (expected)
        TEST_ASSERT_NULL_MESSAGE(fgets(line, sizeof line, expected), "more frames were due");
    if (renewed) {
        fclose(renewed);
        renewed = NULL;
        check_renewal(s, path);
        TEST_IGNORE_MESSAGE("the results were renewed, not compared");
    }
}

static void test_body_computes_the_committed_bits(void) {
    check(&scenarios[0]);
}

static void test_world_computes_the_committed_bits(void) {
    check(&scenarios[1]);
}

static void test_localization_computes_the_committed_bits(void) {
    check(&scenarios[2]);
}

static void test_mapping_computes_the_committed_bits(void) {
    check(&scenarios[3]);
}

/* Twists and pictures contradict each other, which no other setting has. */
static void test_slipping_wheels_compute_the_committed_bits(void) {
    check(&scenarios[4]);
    TEST_ASSERT_GREATER_THAN_UINT32(0, filter.totals.contradictions);
}

static void test_an_imu_that_starts_at_rest_computes_the_committed_bits(void) {
    check(&scenarios[5]);
    TEST_ASSERT_TRUE(filter.source.inertial.phase >= PLR_IMU_UNSETTLED);
    TEST_ASSERT_GREATER_THAN_UINT32(20, filter.totals.readings); /* wheel and standstill */
}

/* And fixes position and heading anew two seconds later. */
static void test_an_imu_that_starts_in_motion_computes_the_committed_bits(void) {
    check(&scenarios[6]);
    TEST_ASSERT_EQUAL_UINT8(PLR_IMU_SETTLED, filter.source.inertial.phase);
}

/* The same start, and all but the baseline is estimated on the way. */
static void test_an_estimated_calibration_computes_the_committed_bits(void) {
    check(&scenarios[7]);
    TEST_ASSERT_EQUAL_UINT(10, filter.camera.errors.estimated);
    TEST_ASSERT_TRUE(filter.camera.estimate.told[0] < PLR_R(0.9));
}
