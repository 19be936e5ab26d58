// SPDX-License-Identifier: MIT
/* An observation of the left picture alone tells a bearing, and begins no landmark; one with a sigma of its
 * own is taken at it. */
#include <math.h>
#include <unity.h>

#include "filter/gate.h"
#include "sensor/stereo.h"
#include "state/covariance.h"
#include "support/rig.h"
#include "support/specimens.h"

static plr_observation seen[PLR_MAX_OBSERVATIONS];
static plr_frame frame;

void setUp(void) {
    rig_set_up();
    rig_drive(5);
    rig_twists();
    frame = scene_look(&rig.world);
    for (unsigned i = 0; i < frame.count; i++)
        seen[i] = frame.observations[i];
    frame.observations = seen;
}

static void hide_right(plr_observation *o) {
    o->uR_px = o->vR_px = PLR_NOT_SEEN_PX;
}

static void update(void) {
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_update(&rig.filter, &frame, &rig.report));
}

static void test_its_measurement_has_an_empty_row_for_the_right_picture(void) {
    const plr_model_kind models[] = {PLR_MODEL_BODY, PLR_MODEL_WORLD};
    for (unsigned i = 0; i < 2; i++) {
        static plr_filter filter;
        rng chance = rng_seeded(5 + i);
        specimen_filter(&filter, &chance, models[i], true, 4);
        const float shift[4] = {1, 2, 3, 4};
        plr_observation o = specimen_observation(&filter, 1, shift);
        plr_measurement both, left;
        TEST_ASSERT_TRUE(plr_stereo_measure(&filter.belief, &filter.camera, 1, &o, &both));
        hide_right(&o);
        TEST_ASSERT_TRUE(plr_stereo_measure(&filter.belief, &filter.camera, 1, &o, &left));
        for (unsigned t = 0; t < left.H.terms; t++)
            for (unsigned row = 0; row < PLR_ROWS; row++)
                for (unsigned c = 0; c < left.H.term[t].columns; c++) {
                    const unsigned at = row * left.H.term[t].columns + c;
                    TEST_ASSERT_EQUAL_DOUBLE(row == 1 ? 0 : (double)both.H.term[t].H[at],
                                             (double)left.H.term[t].H[at]);
                }
        TEST_ASSERT_EQUAL_DOUBLE((double)both.r[0], (double)left.r[0]);
        TEST_ASSERT_EQUAL_DOUBLE(0, (double)left.r[1]);
        TEST_ASSERT_DOUBLE_WITHIN(1e-3, (double)both.r[2] - 1, (double)left.r[2]); /* vL alone */
        TEST_ASSERT_EQUAL_DOUBLE(0, (double)left.extra_d2);
    }
}

static void test_it_counts_two_numbers_and_is_used(void) {
    for (unsigned i = 0; i < frame.count; i++)
        hide_right(&seen[i]);
    update();
    TEST_ASSERT_EQUAL_UINT(0, rig.report.refused);
    TEST_ASSERT_GREATER_THAN_UINT(5, rig.report.used);
    TEST_ASSERT_EQUAL_UINT(2 * (rig.report.matched - rig.report.gated), rig.report.nis_dof);
    TEST_ASSERT_EQUAL_UINT(2 * rig.report.used, rig.report.innovation_rows);
    TEST_ASSERT_TRUE(rig.report.nis > 0 && rig.report.nis < 3 * (float)rig.report.nis_dof);
}

static void test_it_begins_no_landmark(void) {
    for (unsigned i = 0; i < frame.count; i++) {
        seen[i].id += 100000;
        hide_right(&seen[i]);
    }
    const unsigned before = rig.filter.belief.count;
    update();
    TEST_ASSERT_EQUAL_UINT(0, rig.report.created);
    TEST_ASSERT_EQUAL_UINT(frame.count, rig.report.poor);
    TEST_ASSERT_EQUAL_UINT(before, rig.filter.belief.count);
}

/* The variance of the inverse range over all landmarks, and of the bearings. */
static void variances(double *range, double *bearing) {
    *range = *bearing = 0;
    for (unsigned slot = 0; slot < rig.filter.belief.count; slot++) {
        plr_real P[9];
        plr_covariance_landmark(&rig.filter.belief, slot, P);
        *range += (double)P[8];
        *bearing += (double)(P[0] + P[4]);
    }
}

/* Of one filter twice: the same frame with and without its right picture. */
static void test_it_tells_the_bearing_and_hardly_the_range(void) {
    static plr_filter start;
    double range[3], bearing[3];
    start = rig.filter;
    for (unsigned with = 0; with < 3; with++) { /* both pictures, the left one, none */
        rig.filter = start;
        for (unsigned i = 0; i < frame.count && with == 1; i++)
            hide_right(&seen[i]);
        frame.count = with == 2 ? 0 : frame.count;
        update();
        variances(&range[with], &bearing[with]);
    }
    TEST_ASSERT_LESS_THAN_DOUBLE(range[1], range[0]);
    TEST_ASSERT_LESS_THAN_DOUBLE(1.5 * bearing[0], bearing[1]);
}

static void test_its_own_sigma_is_the_noise_that_is_taken(void) {
    const plr_observation as_set = seen[0];
    plr_observation sharp = as_set;
    sharp.sigma_px = (float)rig.config.pixel_sigma_px / 4;
    const uint16_t slot = plr_slots_find(&rig.filter.belief, as_set.id);
    plr_measurement a, b;
    TEST_ASSERT_NOT_EQUAL_UINT16(PLR_NO_SLOT, slot);
    TEST_ASSERT_TRUE(plr_stereo_measure(&rig.filter.belief, &rig.filter.camera, slot, &as_set, &a));
    TEST_ASSERT_TRUE(plr_stereo_measure(&rig.filter.belief, &rig.filter.camera, slot, &sharp, &b));
    for (unsigned row = 0; row < PLR_ROWS; row++)
        TEST_ASSERT_DOUBLE_WITHIN(1e-5, 16, (double)(a.R[row] / b.R[row]));
    TEST_ASSERT_DOUBLE_WITHIN(1e-3 * (double)b.extra_d2, (double)b.extra_d2,
                              16 * (double)a.extra_d2);
}

static void test_a_sigma_beyond_reason_is_refused(void) {
    const float bad[] = {-1, 1e-4F, 1e4F, NAN, INFINITY};
    for (unsigned i = 0; i < 5; i++)
        seen[i].sigma_px = bad[i];
    update();
    TEST_ASSERT_EQUAL_UINT(5, rig.report.refused);
}

static void test_half_a_right_pixel_is_refused(void) {
    seen[0].uR_px = PLR_NOT_SEEN_PX;
    seen[1].vR_px = PLR_NOT_SEEN_PX;
    update();
    TEST_ASSERT_EQUAL_UINT(2, rig.report.refused);
}

/* det S / det R, not det S: a blurred point has a large S and tells little. */
static void test_a_budget_takes_the_sharp_ones(void) {
    for (unsigned i = 0; i < frame.count; i++)
        seen[i].sigma_px = i % 2 ? 20.0F : 0.5F;
    frame.budget = 4;
    update();
    for (unsigned k = 0; k < rig.filter.work.sightings.count; k++) {
        const plr_sighting *row = &rig.filter.work.sightings.at[k];
        TEST_ASSERT_FALSE(row->used && row->seen->sigma_px > 1);
    }
    TEST_ASSERT_EQUAL_UINT(4, rig.report.used);
}
