// SPDX-License-Identifier: MIT
/* When the STM32H7's cameras are told an exposure, against a model of their trigger's counter and interrupts: between
 * two pictures, and what went wrong is seen. No emulator has the part. */
#include <stdbool.h>
#include <stdint.h>
#include <string.h>
#include <unity.h>

/* The driver's own include of this is then empty. */
#define PELORUS_CORTEX_M_CORE_H
#define CORE_REGISTER(address) (*model_register(address))

static volatile uint32_t *model_register(uint32_t address);

static uint32_t core_irq_save(void) {
    return 0;
}

static void core_irq_restore(uint32_t primask) {
    (void)primask;
}

#include "../../port/cortex_m/drivers/stm32h7_camera.c"

enum { EXPOSED_MOST = 100, READ_OUT_MOST = 200, COUNTS = 0x40000824 }; /* 10 and 20 ms; TIM4_CNT */

static struct {
    volatile uint32_t count, others;
    uint32_t takes;  /* counts that a write takes */
    unsigned strips; /* until the picture is complete */
    unsigned writes;
    uint8_t devices[4];
    uint16_t rows[4];
    uint8_t deaf;
} part;

static volatile uint32_t *model_register(uint32_t address) {
    return address == COUNTS ? &part.count : &part.others;
}

/* Time goes on by so many counts. */
static void goes_on(uint32_t counts) {
    for (; counts > 0; counts--) {
        part.count = (part.count + 1) % TRIGGER_PERIOD;
        if (part.count == 0)
            camera_trigger_isr();
    }
}

bool mt9v034_expose(uint8_t device, uint16_t rows, mt9v034_write write) {
    (void)write;
    TEST_ASSERT_TRUE(part.writes < 4);
    part.devices[part.writes] = device;
    part.rows[part.writes++] = rows;
    goes_on(part.takes);
    return device != part.deaf;
}

/* --- what the test does not come to --- */

bool mt9v034_start(uint8_t device, bool pattern, uint16_t rows, mt9v034_write write,
                   mt9v034_read read) {
    (void)device, (void)pattern, (void)rows, (void)write, (void)read;
    return true;
}

bool stm32h7_i2c_write(uint8_t device, uint8_t where, uint16_t value) {
    (void)device, (void)where, (void)value;
    return true;
}

bool stm32h7_i2c_read(uint8_t device, uint8_t where, uint16_t *value) {
    (void)device, (void)where, (void)value;
    return true;
}

void stm32h7_i2c_start(void) {
}

uint32_t stm32h7_timer_hz(void) {
    return 240000000;
}

bool stm32h7_has_crystal(void) {
    return true;
}

void stm32h7_cameras_reset(bool on) {
    (void)on;
}

void clock_wait_ms(uint32_t ms) {
    (void)ms;
}

void imu_data_ready(uint64_t t_ns) {
    (void)t_ns;
}

bool capture_begin(capture *c) {
    c->filling = part.strips > 0 ? &c->pairs[0] : NULL;
    return c->filling != NULL;
}

void capture_exposed(capture *c, uint64_t t_ns) {
    (void)c, (void)t_ns;
}

void capture_strip(capture *c, const volatile uint32_t *strip, unsigned (*written)(void)) {
    (void)strip, (void)written;
    if (--part.strips == 0)
        c->filling = NULL;
}

/* --- the tests --- */

static capture both;

void setUp(void) {
    part.count = part.takes = part.writes = part.deaf = 0;
    part.strips = 0;
    part.others = 0;
    camera_stop();
}

static void picture_begins(unsigned strips_to_come) {
    memset(&both, 0, sizeof both);
    part.strips = strips_to_come;
    part.count = TRIGGER_PERIOD - 1;
    pairs = &both;
    goes_on(1);
}

static void strip_comes(void) {
    part.others = DMA_FULL_0;
    camera_strip_isr();
}

/* Counts at which they rest, of the period that has begun; holds that they do so once, and not to its end. */
static uint32_t rests(uint32_t *first) {
    uint32_t count = 0;
    for (; part.count + 1 < TRIGGER_PERIOD; goes_on(1))
        if (camera_rests()) {
            *first = count++ == 0 ? part.count : *first;
            TEST_ASSERT_EQUAL_UINT32(*first + count - 1, part.count);
            TEST_ASSERT_TRUE(part.count + 30 < TRIGGER_PERIOD); /* 3 ms for three writes */
        }
    return count;
}

static void test_cameras_rest_from_the_last_strip_until_the_next_picture_is_near(void) {
    for (uint32_t ends = 80; ends <= EXPOSED_MOST + READ_OUT_MOST; ends++) {
        uint32_t first = 0;
        setUp();
        picture_begins(2);
        goes_on(ends - 10);
        TEST_ASSERT_FALSE(camera_rests());
        strip_comes();
        TEST_ASSERT_FALSE(camera_rests());
        goes_on(10);
        TEST_ASSERT_FALSE(camera_rests());
        strip_comes();
        TEST_ASSERT_EQUAL_UINT32(EXPOSE_UNTIL - ends, rests(&first));
        TEST_ASSERT_EQUAL_UINT32(ends, first);
    }
}

/* The one before was complete: that tells nothing of this one. */
static void test_cameras_rest_without_a_last_strip_when_the_longest_picture_is_read_out(void) {
    const unsigned strips_to_come[] = {0, 2}; /* left out, for no pair is free; or cut */
    for (unsigned i = 0; i < 2; i++) {
        uint32_t first = 0;
        setUp();
        picture_begins(1);
        goes_on(150);
        strip_comes();
        TEST_ASSERT_TRUE(camera_rests());
        picture_begins(strips_to_come[i]);
        TEST_ASSERT_FALSE(camera_rests());
        if (strips_to_come[i] > 0)
            strip_comes();
        TEST_ASSERT_TRUE(rests(&first) >= 100); /* 10 ms of each 50 */
        TEST_ASSERT_TRUE(first > EXPOSED_MOST + READ_OUT_MOST);
    }
}

/* The counter is at 0 a moment before the trigger's interrupt comes. */
static void test_cameras_do_not_rest_where_a_picture_has_begun_that_no_interrupt_told_yet(void) {
    picture_begins(1);
    goes_on(150);
    strip_comes();
    TEST_ASSERT_TRUE(camera_rests());
    part.count = 0;
    TEST_ASSERT_FALSE(camera_rests());
}

static void test_each_camera_is_told_by_its_address(void) {
    TEST_ASSERT_TRUE(camera_expose(CAMERA_LEFT, 77));
    TEST_ASSERT_TRUE(camera_expose(CAMERA_RIGHT, 78));
    TEST_ASSERT_EQUAL_UINT(2, part.writes);
    TEST_ASSERT_EQUAL_HEX8(LEFT, part.devices[0]);
    TEST_ASSERT_EQUAL_HEX8(RIGHT, part.devices[1]);
    TEST_ASSERT_EQUAL_UINT16(77, part.rows[0]);
    TEST_ASSERT_EQUAL_UINT16(78, part.rows[1]);
}

static void test_a_camera_that_is_not_told_is_seen(void) {
    part.deaf = LEFT;
    TEST_ASSERT_FALSE(camera_expose(CAMERA_LEFT, 77));
    TEST_ASSERT_TRUE(camera_expose(CAMERA_RIGHT, 77));
    part.deaf = RIGHT;
    TEST_ASSERT_TRUE(camera_expose(CAMERA_LEFT, 77));
    TEST_ASSERT_FALSE(camera_expose(CAMERA_RIGHT, 77));
}

/* Wherever a bus that hangs, 16 ms a write at most, may end. */
static void test_a_picture_that_began_between_is_seen(void) {
    for (uint32_t begun = 80; begun < EXPOSE_UNTIL; begun++)
        for (uint32_t takes = 0; takes <= 160; takes++) {
            setUp();
            part.count = begun, part.takes = takes;
            const uint32_t before = camera_triggered();
            TEST_ASSERT_TRUE(camera_expose(CAMERA_LEFT, 77));
            TEST_ASSERT_TRUE(camera_expose(CAMERA_RIGHT, 77));
            TEST_ASSERT_TRUE(camera_expose(CAMERA_LEFT, 76));
            TEST_ASSERT_EQUAL(begun + 3 * takes < TRIGGER_PERIOD, camera_triggered() == before);
        }
}
