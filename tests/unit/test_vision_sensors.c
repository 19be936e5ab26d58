// SPDX-License-Identifier: MIT
/* A board's cameras and IMU beside a session (port/cortex_m/sensors_stereo.c), with a camera, an IMU and a clock that
 * are played: the start, its refusals, and the order in which a busy loop hands over what came. */
#include <string.h>
#include <unity.h>

#include "../../port/cortex_m/capture.c"
#include "../../port/cortex_m/sensors_stereo.c"
#include "support/random.h"
#include "support/session_inertial.h"

#define MS UINT64_C(1000000)

enum { STRIPS = HEIGHT / STRIP_ROWS, STRIP_WORDS = STRIP_ROWS * WIDTH / 2 };

const double imu_accel_unit = 0.005, imu_gyro_unit = 0.001;

static struct {
    uint64_t now_ns, next_reading_ns, next_picture_ns;
    readings *readings;
    capture *pairs;
    bool pattern, running;
    unsigned frame, feeds, starts, out_of_step, exposed_rows;
    const char *dead_camera, *dead_imu, *dead_clock;
    uint32_t strip[STRIP_WORDS];
    uint64_t exposure_ns, readout_ns, exposed_ns;
} world;

/* --- the world --- */

static unsigned other_bank(void) {
    return 1 - capture_bank(world.pairs);
}

/* Grey levels that no two frames share; the test pattern is the same in both, but for a sensor that is a clock late. */
static void read_out(void) {
    const unsigned shift = world.pattern && world.starts <= world.out_of_step;
    for (unsigned strip = 0; strip < STRIPS; strip++) {
        for (uint32_t i = 0; i < STRIP_WORDS; i++) {
            const uint32_t a = (2 * i + world.frame) % 127, b = (2 * i + 1 + world.frame) % 127;
            world.strip[i] = a | (a + shift) << 7 | b << 16 | (b + shift) << 23;
        }
        capture_strip(world.pairs, world.strip, other_bank);
    }
    world.frame++;
}

/* What happens up to now, in its order: a picture is triggered, exposed, read out; readings come. */
static void play(uint64_t until_ns) {
    while (world.now_ns < until_ns) {
        world.now_ns += MS / 2;
        if (world.readings != NULL && world.now_ns >= world.next_reading_ns) {
            const int16_t noise = (int16_t)(world.now_ns / MS % 7);
            const reading one = {.t_ns = world.next_reading_ns,
                                 .accel = {noise, (int16_t)-noise, (int16_t)(1962 + noise)},
                                 .gyro = {(int16_t)(noise / 2), noise, 0}};
            readings_put(world.readings, &one);
            world.next_reading_ns += 5 * MS;
        }
        if (!world.running || world.now_ns < world.next_picture_ns)
            continue;
        if (world.exposed_ns == 0 && capture_begin(world.pairs)) {
            world.exposed_ns = world.next_picture_ns + world.exposure_ns;
            capture_exposed(world.pairs, world.next_picture_ns + world.exposure_ns / 2);
        }
        if (world.exposed_ns == 0)
            world.next_picture_ns += 50 * MS;
        else if (world.now_ns >= world.exposed_ns + world.readout_ns) {
            read_out();
            world.exposed_ns = 0;
            world.next_picture_ns += 50 * MS;
        }
    }
}

uint64_t clock_ns(void) {
    play(world.now_ns + MS);
    return world.now_ns;
}

uint64_t moments_now_ns(void) {
    return world.now_ns;
}

void board_watchdog_feed(void) {
    world.feeds++;
}

const char *moments_start(void) {
    return world.dead_clock;
}

const char *imu_start(readings *queue_of_loop) {
    world.readings = world.dead_imu == NULL ? queue_of_loop : NULL;
    world.next_reading_ns = world.now_ns + MS;
    return world.dead_imu;
}

const char *camera_start(capture *into, bool pattern) {
    world.pairs = into;
    world.pattern = pattern;
    world.running = world.dead_camera == NULL;
    world.next_picture_ns = world.now_ns + 3 * MS;
    world.exposed_ns = 0;
    world.starts++;
    return world.dead_camera;
}

void camera_stop(void) {
    world.running = false;
}

void camera_expose(uint16_t rows) {
    world.exposed_rows = rows;
}

/* --- the tests --- */

void setUp(void) {
    memset(&world, 0, sizeof world);
    world.now_ns = 1000 * MS;
    world.exposure_ns = 5 * MS;
    world.readout_ns = 10 * MS;
    memset(&queue, 0, sizeof queue);
    started = false;
    desk_clear(1);
}

/* Pictures of this size are those of HEADER's camera, which has no others. */
static void begin_session(void) {
    plr_message header = inertial_header();
    header.as.header.image_width_px = WIDTH;
    header.as.header.image_height_px = HEIGHT;
    options.eyes = firmware_eyes();
    options.output |= sensors_output;
    TEST_ASSERT_NOT_NULL(options.eyes);
    desk_begin();
    desk_send(header);
    desk_run();
}

static void test_cameras_in_step_and_an_imu_start(void) {
    TEST_ASSERT_NULL(sensors_start());
    TEST_ASSERT_TRUE(world.running);
    TEST_ASSERT_FALSE(world.pattern);
    TEST_ASSERT_EQUAL_UINT(EXPOSURE_FIRST, world.exposed_rows);
    TEST_ASSERT_TRUE(world.feeds > 0);
}

static void test_cameras_that_come_into_step_later_start(void) {
    world.out_of_step = TRIES - 1;
    TEST_ASSERT_NULL(sensors_start());
}

static void test_cameras_that_stay_out_of_step_are_told_and_off(void) {
    world.out_of_step = TRIES;
    const char *trouble = sensors_start();
    TEST_ASSERT_NOT_NULL(trouble);
    TEST_ASSERT_NOT_NULL(strstr(trouble, "not read out in step"));
    TEST_ASSERT_FALSE(world.running);
}

static void test_pictures_that_do_not_come_are_told_in_bounded_time(void) {
    const uint64_t start_ns = world.now_ns;
    world.readout_ns = 10000 * MS;
    const char *trouble = sensors_start();
    TEST_ASSERT_NOT_NULL(trouble);
    TEST_ASSERT_NOT_NULL(strstr(trouble, "no picture comes"));
    TEST_ASSERT_TRUE(world.now_ns - start_ns < 2000 * MS);
}

static void test_each_part_that_is_dead_is_told_and_nothing_is_handed_over(void) {
    const char *dead = "dead";
    const char **parts[] = {&world.dead_camera, &world.dead_imu, &world.dead_clock};
    for (unsigned i = 0; i < 3; i++) {
        setUp();
        *parts[i] = dead;
        TEST_ASSERT_EQUAL_PTR(dead, sensors_start());
        TEST_ASSERT_FALSE(world.running);
        begin_session();
        play(world.now_ns + 200 * MS);
        sensors_step(&session);
        TEST_ASSERT_EQUAL_UINT32(0, session.totals.imus);
        TEST_ASSERT_EQUAL_UINT32(0, eyes.totals.pairs);
    }
}

/* Of the log that the host gets: each pair behind the readings up to its time, before those after it. */
static void assert_in_order(unsigned pairs_expected) {
    plr_message m;
    uint64_t newest_ns = 0, pair_ns = 0;
    unsigned found = 0;
    while (faulty_port_answer(&port, &m)) {
        if (m.kind == PLR_KIND_IMU) {
            TEST_ASSERT_TRUE(m.as.imu.t_ns > newest_ns && m.as.imu.t_ns > pair_ns);
            newest_ns = m.as.imu.t_ns;
        } else if (m.kind == PLR_KIND_STEREO) {
            pair_ns = m.as.stereo.t_ns;
            TEST_ASSERT_TRUE(newest_ns <= pair_ns && newest_ns + 5 * MS > pair_ns);
            found++;
        }
    }
    TEST_ASSERT_TRUE(found >= pairs_expected);
    faulty_port_answers_again(&port);
}

static void test_a_busy_loop_hands_over_readings_and_pairs_in_order(void) {
    rng chance = rng_seeded(7);
    TEST_ASSERT_NULL(sensors_start());
    begin_session();
    const uint64_t end_ns = world.now_ns + 2000 * MS;
    while (world.now_ns < end_ns) {
        sensors_step(&session);
        play(world.now_ns + (rng_uniform(&chance, 0, 1) < 0.2 ? 45 * MS : MS));
    }
    desk_assert_nothing_refused();
    faulty_port_answers_again(&port);
    assert_in_order(30);
    TEST_ASSERT_EQUAL_UINT32(0, queue.lost);
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.late);
    TEST_ASSERT_EQUAL_UINT32(0, pairs.broken);
}

static void test_before_a_header_nothing_is_handed_over_and_the_exposure_settles(void) {
    world.exposure_ns = 1 * MS;
    options.eyes = firmware_eyes();
    TEST_ASSERT_NULL(sensors_start());
    desk_begin();
    for (unsigned i = 0; i < 200; i++) {
        sensors_step(&session);
        play(world.now_ns + MS);
    }
    TEST_ASSERT_EQUAL_UINT32(0, session.totals.imus);
    TEST_ASSERT_EQUAL_UINT32(0, queue.lost);
    TEST_ASSERT_EQUAL_UINT32(0, eyes.totals.pairs);
    TEST_ASSERT_TRUE(pairs.done >= 3);
}
