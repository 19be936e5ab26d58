// SPDX-License-Identifier: MIT
/* What every small sensor of the table says of the state: a new one is checked as soon as it is there. */
#include <math.h>
#include <string.h>
#include <unity.h>

#include "sensor/sensor.h"
#include "state/blocks.h"
#include "support/matrices.h"
#include "support/rigid.h"
#include "support/specimens.h"

enum { TRIALS = 20, ALL = 7 };

static plr_filter filter;
static rng chance;
static char message[96];

void setUp(void) {
    chance = rng_seeded(3);
}

static plr_reading reading_of(unsigned sensor, unsigned axes) {
    plr_reading reading = {.t_ns = 1000000000, .sensor = (uint8_t)sensor, .axes = (uint8_t)axes};
    for (int i = 0; i < 3; i++) {
        reading.sigma[i] = 0.1 * (i + 1);
        reading.at_B_m[i] = rng_normal(&chance);
    }
    return reading;
}

/* As the filter asks for it. */
static plr_measurement rows_of(const plr_reading *reading) {
    plr_measurement m;
    memset(&m, 0, sizeof m);
    for (int i = 0; i < PLR_ROWS; i++)
        m.R[i] = 1;
    plr_sensor_of(reading->sensor)->of_state(&filter.belief, reading, &m);
    return m;
}

/* The reading that is predicted: short steps of Newton's, for an angle's residual bends. */
static void predict(plr_reading *reading) {
    for (int pass = 0; pass < 50; pass++) {
        const plr_measurement m = rows_of(reading);
        for (int i = 0; i < PLR_ROWS; i++)
            reading->value[i] -= fmax(-1, fmin(1, (double)m.r[i]));
    }
}

/* r at T Exp(xi), xi = h along one of the six directions. */
static void residual_beside(const plr_reading *reading, int direction, double h,
                            plr_real r[PLR_ROWS]) {
    const plr_filter before = filter;
    double xi[6] = {0}, T[16], E[16], moved[16];
    plr_pose pose;
    for (int i = 0; i < 9; i++)
        pose.R[i] = (double)filter.belief.R_WB[i];
    memcpy(pose.p, filter.belief.p_WB, sizeof pose.p);
    xi[direction] = h;
    rigid_from_pose(T, &pose);
    rigid_exp(E, xi);
    square_multiply(4, T, E, moved);
    rigid_to_pose(&pose, moved);
    for (int i = 0; i < 9; i++)
        filter.belief.R_WB[i] = (plr_real)pose.R[i];
    memcpy(filter.belief.p_WB, pose.p, sizeof pose.p);
    const plr_measurement m = rows_of(reading);
    memcpy(r, m.r, sizeof m.r);
    filter = before;
}

static void compare_with_differences(const plr_reading *reading) {
    const double h = cbrt((double)REAL_EPSILON);
    const plr_measurement m = rows_of(reading);
    const plr_term *pose = &m.H.term[0];
    TEST_ASSERT_EQUAL_UINT(1, m.H.terms);
    TEST_ASSERT_EQUAL_UINT(plr_row_of(&filter.belief, PLR_BLOCK_POSE), pose->row);
    TEST_ASSERT_EQUAL_UINT(PLR_POSE_DIM, pose->columns);
    for (int c = 0; c < PLR_POSE_DIM; c++) {
        plr_real ahead[PLR_ROWS], behind[PLR_ROWS];
        residual_beside(reading, c, h, ahead);
        residual_beside(reading, c, -h, behind);
        for (int i = 0; i < PLR_ROWS; i++) {
            snprintf(message, sizeof message, "sensor %u: H row %d, column %d", reading->sensor, i,
                     c);
            const double due = -((double)ahead[i] - (double)behind[i]) / (2 * h);
            /* the third derivative, and rounding of r over h */
            TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(10 * h * h * pow(1 + fabs(due), 3) +
                                                  100 * REAL_EPSILON / h,
                                              due, (double)pose->H[PLR_POSE_DIM * i + c], message);
        }
    }
}

static void test_H_of_a_sensor_of_the_pose_is_the_derivative_of_its_prediction(void) {
    for (unsigned sensor = 1; sensor <= PLR_SENSORS; sensor++) {
        if (!plr_sensor_of(sensor)->of_state)
            continue;
        for (int trial = 0; trial < TRIALS; trial++) {
            plr_reading reading = reading_of(sensor, ALL);
            specimen_filter(&filter, &chance, trial % 2 ? PLR_MODEL_WORLD : PLR_MODEL_BODY,
                            trial % 3 > 0, 2);
            predict(&reading);
            const plr_measurement m = rows_of(&reading);
            for (int i = 0; i < PLR_ROWS; i++)
                TEST_ASSERT_DOUBLE_WITHIN(100 * REAL_EPSILON, 0, (double)m.r[i]);
            compare_with_differences(&reading);
        }
    }
}

static void demand_silence(unsigned sensor, unsigned i, const plr_real *H, plr_real r, plr_real R) {
    snprintf(message, sizeof message, "sensor %u, row %u", sensor, i);
    TEST_ASSERT_TRUE_MESSAGE(r == 0 && R == 1, message);
    for (int c = 0; c < PLR_POSE_DIM; c++)
        TEST_ASSERT_TRUE_MESSAGE(H[c] == 0, message);
}

static void test_a_number_that_was_not_measured_says_nothing(void) {
    specimen_filter(&filter, &chance, PLR_MODEL_BODY, true, 2);
    for (unsigned sensor = 1; sensor <= PLR_SENSORS; sensor++)
        for (unsigned axes = 1; axes < ALL; axes++) {
            const plr_reading reading = reading_of(sensor, axes);
            const plr_sensor_kind *kind = plr_sensor_of(sensor);
            plr_measurement m = {0};
            plr_twist_rows rows[2];
            if (kind->of_state)
                m = rows_of(&reading);
            const unsigned parts = kind->of_twist ? kind->of_twist(&reading, rows) : 0;
            for (unsigned i = 0; i < PLR_ROWS; i++) {
                /* three rows a number, or one */
                const bool measured = (axes >> i & 1U) != 0;
                for (unsigned part = 0; parts == 2 && part < parts; part++)
                    if ((axes >> part & 1U) == 0)
                        demand_silence(sensor, i, rows[part].M + PLR_POSE_DIM * i, rows[part].z[i],
                                       rows[part].R[i]);
                if (parts == 1 && !measured)
                    demand_silence(sensor, i, rows->M + PLR_POSE_DIM * i, rows->z[i], rows->R[i]);
                if (kind->of_state && !measured)
                    demand_silence(sensor, i, m.H.term[0].H + PLR_POSE_DIM * i, m.r[i], m.R[i]);
            }
        }
}

static void test_a_sensor_is_of_the_state_or_of_the_twist(void) {
    TEST_ASSERT_NULL(plr_sensor_of(0));
    TEST_ASSERT_NULL(plr_sensor_of(PLR_SENSORS + 1));
    for (unsigned sensor = 1; sensor <= PLR_SENSORS; sensor++) {
        const plr_sensor_kind *kind = plr_sensor_of(sensor);
        TEST_ASSERT_NOT_NULL(kind);
        TEST_ASSERT_TRUE((kind->of_state != NULL) != (kind->of_twist != NULL));
    }
}
