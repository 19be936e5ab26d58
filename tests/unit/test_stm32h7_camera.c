// SPDX-License-Identifier: MIT
/* When the STM32H7's cameras are told an exposure, against a model of their trigger's counter: between two pictures,
 * and what went wrong is seen. No emulator has the part. */
#include <stdbool.h>
#include <stdint.h>
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
    uint32_t takes; /* counts that a write takes */
    unsigned writes;
    uint8_t devices[4];
    uint16_t rows[4];
    uint8_t deaf;
} part;

static volatile uint32_t *model_register(uint32_t address) {
    return address == COUNTS ? &part.count : &part.others;
}

bool mt9v034_expose(uint8_t device, uint16_t rows, mt9v034_write write) {
    (void)write;
    TEST_ASSERT_TRUE(part.writes < 4);
    part.devices[part.writes] = device;
    part.rows[part.writes++] = rows;
    part.count = (part.count + part.takes) % TRIGGER_PERIOD;
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
    (void)c;
    return true;
}

void capture_exposed(capture *c, uint64_t t_ns) {
    (void)c, (void)t_ns;
}

void capture_strip(capture *c, const volatile uint32_t *strip, unsigned (*written)(void)) {
    (void)c, (void)strip, (void)written;
}

/* --- the tests --- */

void setUp(void) {
    part.count = part.takes = part.writes = part.deaf = 0;
}

static void test_cameras_rest_when_the_longest_picture_is_read_out_and_the_next_is_not_near(void) {
    unsigned rests = 0;
    for (part.count = 0; part.count < TRIGGER_PERIOD; part.count++)
        if (camera_rests()) {
            rests++;
            TEST_ASSERT_TRUE(part.count > EXPOSED_MOST + READ_OUT_MOST);
            TEST_ASSERT_TRUE(part.count + 20 < TRIGGER_PERIOD); /* 2 ms for two writes */
        }
    TEST_ASSERT_TRUE(rests >= 100); /* 10 ms of each 50 */
}

static void test_both_cameras_are_told_the_same_one_after_the_other(void) {
    part.count = 320, part.takes = 4;
    TEST_ASSERT_TRUE(camera_expose(77));
    TEST_ASSERT_EQUAL_UINT(2, part.writes);
    TEST_ASSERT_EQUAL_HEX8(LEFT, part.devices[0]);
    TEST_ASSERT_EQUAL_HEX8(RIGHT, part.devices[1]);
    TEST_ASSERT_EQUAL_UINT16(77, part.rows[0]);
    TEST_ASSERT_EQUAL_UINT16(77, part.rows[1]);
}

static void test_a_camera_that_is_not_told_is_seen(void) {
    const uint8_t deaf[] = {LEFT, RIGHT};
    for (unsigned i = 0; i < 2; i++) {
        setUp();
        part.count = 320, part.deaf = deaf[i];
        TEST_ASSERT_FALSE(camera_expose(77));
    }
}

/* Wherever a bus that hangs, 16 ms a write at most, may end. */
static void test_a_picture_that_began_between_is_seen(void) {
    for (uint32_t begun = REST_BEGINS; begun < EXPOSE_UNTIL; begun++)
        for (uint32_t takes = 0; takes <= 160; takes++) {
            setUp();
            part.count = begun, part.takes = takes;
            TEST_ASSERT_TRUE(camera_rests());
            TEST_ASSERT_EQUAL(begun + 2 * takes < TRIGGER_PERIOD, camera_expose(77));
        }
}
