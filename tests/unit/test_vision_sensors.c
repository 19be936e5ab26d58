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

enum {
    STRIPS = HEIGHT / STRIP_ROWS,
    STRIP_WORDS = STRIP_ROWS * WIDTH / 2,
    LATE = 2, /* pictures that still have the exposure before a change */
    WRITTEN = LATE + 1,
    APART = 64
};

const double imu_accel_unit = 0.005, imu_gyro_unit = 0.001;

static struct {
    uint64_t now_ns, next_reading_ns, next_picture_ns;
    readings *readings;
    capture *pairs;
    bool pattern, running;
    bool read_out; /* the picture that was triggered last */
    unsigned frame, feeds, starts, out_of_step, triggers;
    const char *dead_camera, *dead_imu, *dead_clock;
    uint32_t strip[STRIP_WORDS];
    uint64_t readout_ns, exposed_ns;
    uint64_t look_ns, write_ns; /* what one takes */
    double light;               /* grey levels over those of EXPOSURE_FIRST's */
    /* of exposure, left and right: of this picture, ..., as written */
    unsigned rows[2][WRITTEN + 1];
    unsigned writes, answered[2];
    unsigned deaf[2]; /* the left and right camera do not take the next so many */
    unsigned dull[2]; /* before them they take so many */
    unsigned mute[2]; /* and of these they do not answer so many, but take them */
    unsigned apart;   /* pictures whose exposures differed, and their times */
    uint64_t apart_ns[APART];
} world;

/* --- the world --- */

static unsigned other_bank(void) {
    return 1 - capture_bank(world.pairs);
}

static uint32_t grey(uint32_t level, unsigned side) {
    const double exposed = world.light * world.rows[side][0] / EXPOSURE_FIRST * level;
    return exposed < 127 ? (uint32_t)exposed : 127;
}

/* Grey levels that no two frames share; the test pattern is the same in both, but for a sensor that is a clock late. */
static void read_out(void) {
    const unsigned shift = world.starts <= world.out_of_step;
    for (unsigned strip = 0; strip < STRIPS; strip++) {
        for (uint32_t i = 0; i < STRIP_WORDS; i++) {
            const uint32_t a = (2 * i + world.frame) % 127, b = (2 * i + 1 + world.frame) % 127;
            world.strip[i] =
                world.pattern ? a | (a + shift) << 7 | b << 16 | (b + shift) << 23
                              : grey(a, 0) | grey(a, 1) << 7 | grey(b, 0) << 16 | grey(b, 1) << 23;
        }
        capture_strip(world.pairs, world.strip, other_bank);
    }
    world.frame++;
}

/* The sensors take over what was written so many pictures ago. */
static void trigger(void) {
    for (unsigned side = 0; side < 2; side++)
        for (unsigned i = 0; i < WRITTEN; i++)
            world.rows[side][i] = world.rows[side][i + 1];
    const uint64_t exposure_ns = world.rows[0][0] * UINT64_C(32000);
    const uint64_t middle_ns = world.next_picture_ns + exposure_ns / 2;
    world.triggers++;
    world.read_out = false;
    world.exposed_ns = 0;
    if (world.rows[0][0] != world.rows[1][0]) {
        TEST_ASSERT_TRUE(world.apart < APART);
        world.apart_ns[world.apart++] = middle_ns;
    }
    if (capture_begin(world.pairs)) {
        world.exposed_ns = world.next_picture_ns + exposure_ns;
        capture_exposed(world.pairs, middle_ns);
    }
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
        if (!world.running)
            continue;
        if (world.exposed_ns != 0 && world.now_ns >= world.exposed_ns + world.readout_ns) {
            read_out();
            world.exposed_ns = 0;
            world.read_out = true;
        }
        if (world.now_ns >= world.next_picture_ns) {
            trigger();
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

const char *camera_start(capture *into, bool pattern, uint16_t exposure_rows) {
    for (unsigned i = 0; i <= WRITTEN; i++)
        world.rows[0][i] = world.rows[1][i] = exposure_rows;
    world.answered[0] = world.answered[1] = exposure_rows;
    world.pairs = into;
    world.pattern = pattern;
    world.running = world.dead_camera == NULL;
    world.next_picture_ns = world.now_ns + 3 * MS;
    world.exposed_ns = 0;
    world.read_out = false;
    world.starts++;
    return world.dead_camera;
}

void camera_stop(void) {
    world.running = false;
}

/* As drivers/stm32h7_camera.c, whose counter has 0.1 ms: from 31 ms on where no last strip came. */
bool camera_rests(void) {
    const uint64_t since_ns = world.now_ns + 50 * MS - world.next_picture_ns;
    return since_ns > 0 && (world.read_out || since_ns >= 31 * MS) && since_ns < 46 * MS;
}

uint32_t camera_triggered(void) {
    return world.triggers;
}

/* A change comes while the last picture of the left camera was exposed as it was last told: only then does its grey
 * level tell something. */
bool camera_expose(camera_side side, uint16_t rows) {
    if (world.answered[0] == world.answered[1] && world.rows[0][WRITTEN] != rows)
        TEST_ASSERT_EQUAL_UINT(world.rows[0][WRITTEN], world.rows[0][0]);
    world.writes++;
    const bool takes_it = world.deaf[side] == 0 || world.dull[side] > 0;
    if (takes_it)
        world.rows[side][WRITTEN] = rows;
    if (world.dull[side] > 0)
        world.dull[side]--;
    else if (!takes_it)
        world.deaf[side]--;
    play(world.now_ns + world.write_ns);
    if (world.mute[side] > 0) {
        world.mute[side]--;
        return false;
    }
    world.answered[side] = takes_it ? rows : world.answered[side];
    return takes_it;
}

/* --- the tests --- */

void setUp(void) {
    memset(&world, 0, sizeof world);
    world.now_ns = 1000 * MS;
    world.light = 0.75;
    world.readout_ns = 10 * MS;
    world.write_ns = MS / 2;
    memset(&queue, 0, sizeof queue);
    started = false;
    desk_clear(1);
}

static const plr_eyes_calls *looks;

static plr_status look_slowly(plr_eyes *e, const plr_picture_pair *pair, bool place_known,
                              plr_frame *frame) {
    const plr_status status = looks->look(e, pair, place_known, frame);
    play(world.now_ns + world.look_ns);
    return status;
}

/* Pictures of this size are those of HEADER's camera, which has no others. */
static void begin_session(void) {
    static plr_eyes_calls slow;
    plr_message header = inertial_header();
    header.as.header.image_width_px = WIDTH;
    header.as.header.image_height_px = HEIGHT;
    options.eyes = firmware_eyes();
    options.output |= sensors_output;
    TEST_ASSERT_NOT_NULL(options.eyes);
    looks = options.eyes->calls;
    slow = *looks;
    slow.look = look_slowly;
    options.eyes->calls = &slow;
    desk_begin();
    desk_send(header);
    desk_run();
}

static void test_cameras_in_step_and_an_imu_start(void) {
    TEST_ASSERT_NULL(sensors_start());
    TEST_ASSERT_TRUE(world.running);
    TEST_ASSERT_FALSE(world.pattern);
    TEST_ASSERT_EQUAL_UINT(EXPOSURE_FIRST, world.rows[0][0]);
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

static void test_before_a_header_nothing_is_handed_over(void) {
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

/* --- exposure --- */

/* No pair that was handed over had two exposures. */
static void assert_exposed_alike(void) {
    plr_message m;
    faulty_port_answers_again(&port);
    while (faulty_port_answer(&port, &m))
        for (unsigned i = 0; i < world.apart && m.kind == PLR_KIND_STEREO; i++)
            TEST_ASSERT_TRUE(m.as.stereo.t_ns != world.apart_ns[i]);
}

/* Returns how often something was told; `told` is the last of it. */
static const char *told;

static unsigned run_for(uint64_t ns) {
    const uint64_t end_ns = world.now_ns + ns;
    unsigned count = 0;
    while (world.now_ns < end_ns) {
        const char *trouble = sensors_step(&session);
        told = trouble != NULL ? trouble : told;
        count += trouble != NULL;
        play(world.now_ns + MS);
    }
    return count;
}

static void begin_and_settle(void) {
    TEST_ASSERT_NULL(sensors_start());
    begin_session();
    run_for(500 * MS);
}

/* By half and more, and both cameras alike. */
static void assert_brighter(void) {
    TEST_ASSERT_TRUE(world.rows[0][0] > EXPOSURE_FIRST * 3 / 2);
    TEST_ASSERT_EQUAL_UINT(world.rows[0][0], world.rows[1][0]);
}

/* camera_expose above holds that each change comes from a picture with the exposure before it. */
static void test_a_change_of_light_is_followed_by_one_change_of_exposure_that_is_waited_for(void) {
    begin_and_settle();
    TEST_ASSERT_EQUAL_UINT(0, world.writes);
    world.light = 0.4;
    run_for(1000 * MS);
    assert_brighter();
    TEST_ASSERT_EQUAL_UINT(2, world.writes); /* one of each camera */
}

/* A pair is ready some 15 ms after its trigger, and the loop idles again when a look of it ends. Looks of two periods
 * leave each second picture out, and end in it. */
static void test_the_exposure_is_written_however_long_a_look_takes(void) {
    static const uint64_t looks_ms[] = {40, 100, 0, 16, 32, 50, 74, 90, 98, 110};
    const size_t few = PELORUS_SHORT_FORM ? 2 : sizeof looks_ms / sizeof *looks_ms;
    for (size_t i = 0; i < few; i++) {
        const uint64_t look_ms = looks_ms[i];
        setUp();
        world.look_ns = look_ms * MS;
        begin_and_settle();
        world.light = 0.4;
        run_for(1500 * MS);
        assert_brighter();
        TEST_ASSERT_EQUAL_UINT(2, world.writes);
        TEST_ASSERT_EQUAL_UINT(0, world.apart);
        TEST_ASSERT_TRUE(exposure.left_out <= (look_ms > 90));
    }
}

static void test_no_picture_begins_between_the_two_cameras_exposures(void) {
    const double lights[] = {1, 0.5, 1.6, 0.7, 2.5};
    rng chance = rng_seeded(3);
    TEST_ASSERT_NULL(sensors_start());
    begin_session();
    for (unsigned i = 0; i < 40; i++) {
        const uint64_t end_ns = world.now_ns + 300 * MS;
        world.light = lights[i % 5];
        while (world.now_ns < end_ns) {
            sensors_step(&session);
            play(world.now_ns + (uint64_t)(rng_uniform(&chance, 0, 60) * (double)MS));
        }
    }
    TEST_ASSERT_TRUE(world.writes > 40);
    TEST_ASSERT_EQUAL_UINT(0, world.apart);
    TEST_ASSERT_EQUAL_UINT32(0, exposure.left_out);
}

/* A camera that does not take some exposures costs no pair: the other goes on with what both had. */
static void test_cameras_stay_alike_while_one_does_not_take_an_exposure(void) {
    for (unsigned side = 0; side < 2; side++) {
        setUp();
        begin_and_settle();
        const uint32_t before = eyes.totals.pairs;
        world.light = 0.4;
        world.deaf[side] = REFUSALS - 1;
        TEST_ASSERT_EQUAL_UINT(0, run_for(2000 * MS));
        TEST_ASSERT_EQUAL_UINT(0, world.deaf[side]);
        assert_brighter();
        TEST_ASSERT_EQUAL_UINT(0, world.apart);
        TEST_ASSERT_EQUAL_UINT32(0, exposure.left_out);
        TEST_ASSERT_TRUE(eyes.totals.pairs >= before + 39);
    }
}

static void test_a_camera_that_never_takes_an_exposure_again_is_told_once_and_pairs_go_on(void) {
    for (unsigned side = 0; side < (PELORUS_SHORT_FORM ? 1 : 2); side++) {
        setUp();
        begin_and_settle();
        const uint32_t before = eyes.totals.pairs;
        world.light = 0.4;
        world.deaf[side] = UINT32_MAX;
        TEST_ASSERT_EQUAL_UINT(1, run_for(12000 * MS));
        TEST_ASSERT_NOT_NULL(strstr(told, side == 0 ? "left" : "right"));
        TEST_ASSERT_TRUE(strlen(told) <= PLR_WIRE_MAX_TEXT);
        TEST_ASSERT_TRUE(world.writes < 30); /* it is asked more rarely then, but for ever */
        TEST_ASSERT_TRUE(eyes.totals.pairs >= before + 239);
        TEST_ASSERT_EQUAL_UINT(0, world.apart);
        world.deaf[side] = 0;
        TEST_ASSERT_EQUAL_UINT(0, run_for(12000 * MS));
        assert_brighter();
    }
}

/* The light is as before when the camera that has it all the same is told again. */
static void test_a_camera_that_took_what_it_did_not_answer_is_told_what_both_have(void) {
    begin_and_settle();
    world.light = 0.4;
    world.mute[1] = 1;
    while (world.mute[1] > 0)
        run_for(MS);
    TEST_ASSERT_TRUE(world.rows[0][WRITTEN] != world.rows[1][WRITTEN]);
    world.light = 0.75;
    run_for(500 * MS);
    TEST_ASSERT_EQUAL_UINT(EXPOSURE_FIRST, world.rows[0][0]);
    TEST_ASSERT_EQUAL_UINT(EXPOSURE_FIRST, world.rows[1][0]);
}

/* The right camera takes none, and the left one does not take the old one back. */
static void test_pairs_with_two_exposures_are_left_out_until_both_cameras_have_the_same(void) {
    begin_and_settle();
    const uint32_t before = eyes.totals.pairs;
    world.light = 0.4;
    world.deaf[1] = 20;
    world.dull[0] = 1;
    world.deaf[0] = 3;
    run_for(4000 * MS);
    TEST_ASSERT_EQUAL_UINT(0, world.deaf[0]);
    TEST_ASSERT_TRUE(world.apart > 0);
    TEST_ASSERT_TRUE(exposure.left_out >= world.apart);
    TEST_ASSERT_TRUE(eyes.totals.pairs > before + 40);
    TEST_ASSERT_FALSE(exposure.apart);
    assert_exposed_alike();
}

/* As a bus whose clock is held: a picture has the left camera's new exposure before it takes the old one back. */
static void test_pairs_of_an_attempt_that_a_picture_begins_in_are_left_out(void) {
    begin_and_settle();
    const uint32_t before = eyes.totals.pairs;
    world.light = 0.4;
    world.write_ns = 20 * MS;
    world.deaf[1] = UINT32_MAX;
    run_for(12000 * MS);
    TEST_ASSERT_TRUE(world.apart > 0);
    TEST_ASSERT_TRUE(exposure.left_out >= world.apart);
    TEST_ASSERT_TRUE(exposure.left_out < 50);
    TEST_ASSERT_TRUE(eyes.totals.pairs > before + 190);
    assert_exposed_alike();
}
