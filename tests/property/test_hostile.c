// SPDX-License-Identifier: MIT
/*
 * Every call with every kind of impossible number, in random order, on filters of every mode:
 *   - a refused call leaves the state as it was, bit for bit,
 *   - the filter never gives a number that is not finite,
 *   - P stays symmetric and positive, or the filter says that it diverged.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unity.h>

#include "state/covariance.h"
#include "support/matrices.h"
#include "support/scene.h"
#include "support/specimens.h"

enum { RUNS = 32, CALLS = 250 };

static plr_filter filter, before;
static scene world;
static rng chance;
static plr_observation seen[PLR_MAX_OBSERVATIONS];

void setUp(void) {
    chance = rng_seeded(54);
}

/* One number in a dozen is hostile. */
static double spoil(double x) {
    static const double hostile[] = {0,    -1,    1e-300, -1e-300, 1e-40,  1e20,    -1e20,
                                     1e38, -1e38, 3.5e38, 1e300,   -1e300, 1.7e308, 5e-324};
    enum { KINDS = sizeof hostile / sizeof *hostile };
    if (rng_below(&chance, 12))
        return x;
    const unsigned kind = rng_below(&chance, KINDS + 3);
    if (kind == KINDS)
        return (double)NAN;
    if (kind > KINDS)
        return kind == KINDS + 1 ? (double)INFINITY : -(double)INFINITY;
    return hostile[kind];
}

static void spoil_all(double *x, unsigned n) {
    for (unsigned i = 0; i < n; i++)
        x[i] = spoil(x[i]);
}

/* Only now and then, so that calls get through. */
static bool attacks(void) {
    return rng_below(&chance, 3) == 0;
}

static plr_time_ns some_time(void) {
    static const plr_time_ns odd[] = {0, 1, UINT64_MAX, UINT64_MAX / 2, 1000000000};
    if (attacks())
        return rng_below(&chance, 2) ? odd[rng_below(&chance, 5)]
                                     : world.t_ns - 100000000 + rng_below(&chance, 200000000);
    return world.t_ns;
}

static plr_status call_predict(void) {
    plr_twist twist = scene_read(&world);
    if (attacks()) {
        spoil_all(twist.v_B_mps, 3);
        spoil_all(twist.w_B_radps, 3);
    }
    return plr_filter_predict(&filter, some_time(), &twist);
}

static plr_status call_update(void) {
    plr_frame frame = scene_look(&world);
    plr_report report;
    memcpy(seen, frame.observations, frame.count * sizeof *seen);
    frame.observations = seen;
    frame.t_ns = some_time();
    if (attacks()) {
        for (unsigned i = 0; i < frame.count; i++) {
            seen[i].uL_px = (float)spoil((double)seen[i].uL_px);
            seen[i].vL_px = (float)spoil((double)seen[i].vL_px);
            seen[i].uR_px = (float)spoil((double)seen[i].uR_px);
            seen[i].vR_px = (float)spoil((double)seen[i].vR_px);
            if (rng_below(&chance, 20) == 0)
                seen[i].id = seen[0].id;
        }
        frame.budget = (uint16_t)rng_below(&chance, 30);
        if (rng_below(&chance, 8) == 0)
            frame.count = PLR_MAX_OBSERVATIONS + 1;
        if (rng_below(&chance, 8) == 0)
            frame.observations = NULL;
    }
    const plr_status status =
        plr_filter_update(&filter, &frame, rng_below(&chance, 2) ? &report : NULL);
    /* a diverged filter still predicts: that is no refusal */
    return status == PLR_E_DIVERGED ? PLR_OK : status;
}

static void some_pose(plr_pose *T_WB) {
    scene_pose(&world, T_WB);
    if (attacks()) {
        spoil_all(T_WB->R, 9);
        spoil_all(T_WB->p, 3);
    }
}

static plr_status call_set_pose(void) {
    plr_pose T_WB;
    double P_xi[36];
    some_pose(&T_WB);
    random_spd(&chance, 6, 1e-3, P_xi);
    for (int i = 0; i < 36; i++)
        P_xi[i] *= 1e-4;
    if (attacks())
        spoil_all(P_xi, 36);
    if (attacks()) {
        const double x = spoil(1);
        for (int i = 0; i < 36; i++) /* huge, and yet symmetric and positive */
            P_xi[i] *= x * x;
    }
    return plr_filter_set_pose(&filter, some_time(), &T_WB, rng_below(&chance, 3) ? P_xi : NULL);
}

static plr_status call_move_to(void) {
    plr_pose T_WB;
    some_pose(&T_WB);
    return plr_filter_move_to(&filter, some_time(), &T_WB);
}

static plr_status call_set_bias(void) {
    double mean[6] = {0.01, 0, 0, 0.001, 0, 0}, variance[6] = {1e-4, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6};
    if (attacks()) {
        spoil_all(mean, 6);
        spoil_all(variance, 6);
    }
    return plr_filter_set_bias(&filter, mean, variance);
}

static plr_status call_insert(void) {
    const uint32_t id = 100 + rng_below(&chance, world.is.landmarks);
    plr_landmark known = scene_known(&world, id, 0.1);
    if (attacks())
        spoil_all(known.p_W_m, 3);
    if (attacks())
        spoil_all(known.P_W_m2, 9);
    return plr_filter_insert_known(&filter, &known);
}

/* A map that holds every landmark, some of them spoilt; and a sink that fails at times. */
static bool source(void *context, uint32_t id, plr_landmark *landmark) {
    (void)context;
    *landmark = scene_known(&world, id, 0.1);
    if (attacks()) {
        spoil_all(landmark->p_W_m, 3);
        spoil_all(landmark->P_W_m2, 9);
    }
    return rng_below(&chance, 5) > 0;
}

static int sink(void *context, const plr_landmark *landmark) {
    (void)context;
    for (int i = 0; i < 9; i++)
        TEST_ASSERT_TRUE(isfinite(landmark->P_W_m2[i]) && isfinite(landmark->p_W_m[i / 3]));
    return (int)rng_below(&chance, 4) - 2;
}

static plr_status call_landmark(void) {
    plr_landmark landmark;
    return plr_filter_landmark(&filter, rng_below(&chance, 60), &landmark);
}

static plr_status call_flush(void) {
    const plr_status status = plr_filter_flush_map(&filter);
    return status == PLR_E_IO ? PLR_OK : status; /* some were taken */
}

typedef struct attack {
    const char *name;
    plr_status (*call)(void);
    unsigned weight;
} attack;

static const attack attacks_of_all_kinds[] = {
    {"predict", call_predict, 40},  {"update", call_update, 12},
    {"set_pose", call_set_pose, 2}, {"move_to", call_move_to, 10},
    {"set_bias", call_set_bias, 3}, {"insert_known", call_insert, 8},
    {"landmark", call_landmark, 4}, {"flush_map", call_flush, 1}};

static const attack *const set_bias = &attacks_of_all_kinds[4];

static const attack *next_attack(void) {
    unsigned left = rng_below(&chance, 80);
    const attack *next = attacks_of_all_kinds;
    while (left >= next->weight)
        left -= next++->weight;
    return next;
}

static void begin(int run) {
    scene_options options;
    plr_config config;
    const plr_map map = {.sink = run % 5 ? sink : NULL, .source = source};
    scene_options_default(&options);
    options.seed = (uint64_t)run + 1;
    options.most_seen = 20;
    scene_start(&world, &options);
    plr_config_default(&config);
    config.model = (uint8_t)(run % 2);
    config.bias = (uint8_t)(run / 2 % 2);
    config.mode = (uint8_t)(run / 4 % 4);
    config.twist_timing = (uint8_t)(run % 3);
    config.known_map = (uint8_t)(run / 3 % 2);
    config.slots = 16;
    TEST_ASSERT_EQUAL_INT(PLR_OK, plr_filter_init(&filter, &world.calibration, &config, &map));
}

static void test_no_input_breaks_the_filter(void) {
    unsigned accepted[8] = {0}, refused[8] = {0};
    for (int run = 0; run < RUNS; run++) {
        begin(run);
        for (int k = 0; k < CALLS; k++) {
            char at[80];
            const attack *next = k < 4 ? set_bias : next_attack(); /* which comes first of all */
            memcpy(&before, &filter, sizeof before);
            const plr_status status = next->call();
            snprintf(at, sizeof at, "run %d, call %d, %s: %s", run, k, next->name,
                     plr_status_text(status));
            if (status != PLR_OK)
                TEST_ASSERT_TRUE_MESSAGE(specimen_same_state(&before, &filter), at);
            memcpy(&before, &filter, sizeof before);
            TEST_ASSERT_TRUE_MESSAGE(specimen_gives_finite_numbers(&before), at);
            TEST_ASSERT_TRUE_MESSAGE(plr_covariance_is_positive(&before.belief), at);
            (status == PLR_OK ? accepted : refused)[next - attacks_of_all_kinds]++;
            scene_move(&world, 5000000);
        }
    }
    for (int kind = 0; kind < 8; kind++) { /* or else the attack was none */
        TEST_ASSERT_GREATER_THAN_UINT_MESSAGE(5, accepted[kind], attacks_of_all_kinds[kind].name);
        TEST_ASSERT_GREATER_THAN_UINT_MESSAGE(5, refused[kind], attacks_of_all_kinds[kind].name);
    }
}
