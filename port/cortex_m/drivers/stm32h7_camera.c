// SPDX-License-Identifier: MIT
/*
 * Two MT9V034 at one DCMI, which takes 14 bits: the upper seven of each sensor. They have one clock (MCO1), one
 * reset and one trigger (TIM4), so that they are read out in step, and the left one's clock and valid lines are for
 * both. TIM2 tells the time: channel 1 and 2 take the ends of the exposure, of the left one's LED_OUT; channel 4 the
 * IMU's line. Registers: RM0433, chapters 16 (DMA), 31 (DCMI), 39 (timers).
 */
#include "../barrier.h"
#include "../camera.h"
#include "../clock.h"
#include "../ticks.h"
#include "mt9v034.h"
#include "stm32h7.h"
#include "stm32h7_i2c.h"

#define DCMI_CR   CORE_REGISTER(0x48020000U)
#define DCMI_RISR CORE_REGISTER(0x48020008U)
#define DCMI_ICR  CORE_REGISTER(0x48020014U)
#define DCMI_DR   0x48020028U

#define TIM2_CR1   CORE_REGISTER(0x40000000U)
#define TIM2_DIER  CORE_REGISTER(0x4000000CU)
#define TIM2_SR    CORE_REGISTER(0x40000010U)
#define TIM2_EGR   CORE_REGISTER(0x40000014U)
#define TIM2_CCMR1 CORE_REGISTER(0x40000018U)
#define TIM2_CCMR2 CORE_REGISTER(0x4000001CU)
#define TIM2_CCER  CORE_REGISTER(0x40000020U)
#define TIM2_CNT   CORE_REGISTER(0x40000024U)
#define TIM2_PSC   CORE_REGISTER(0x40000028U)
#define TIM2_ARR   CORE_REGISTER(0x4000002CU)
#define TIM2_CCR1  CORE_REGISTER(0x40000034U)
#define TIM2_CCR2  CORE_REGISTER(0x40000038U)
#define TIM2_CCR4  CORE_REGISTER(0x40000040U)

#define TIM4_CR1   CORE_REGISTER(0x40000800U)
#define TIM4_DIER  CORE_REGISTER(0x4000080CU)
#define TIM4_SR    CORE_REGISTER(0x40000810U)
#define TIM4_EGR   CORE_REGISTER(0x40000814U)
#define TIM4_CCMR1 CORE_REGISTER(0x40000818U)
#define TIM4_CCER  CORE_REGISTER(0x40000820U)
#define TIM4_CNT   CORE_REGISTER(0x40000824U)
#define TIM4_PSC   CORE_REGISTER(0x40000828U)
#define TIM4_ARR   CORE_REGISTER(0x4000082CU)
#define TIM4_CCR1  CORE_REGISTER(0x40000834U)

enum {
    LEFT = 0x5C,  /* both address pins high */
    RIGHT = 0x48, /* both low */

    DCMI_CAPTURE = 1 << 0,
    DCMI_SNAPSHOT = 1 << 1, /* one picture, then CAPTURE goes by itself */
    DCMI_14_BITS = 3 << 10,
    DCMI_ENABLE = 1 << 14,
    DCMI_OVERRUN = 1 << 1,
    /* Lines are valid while high and data is taken as the clock falls: HSPOL, VSPOL and PCKPOL are 0. */
    DCMI_SETTINGS = DCMI_SNAPSHOT | DCMI_14_BITS,
    DMA_REQUEST_DCMI = 75,
    DMA_FIFO_FULL = 1 << 2 | 3, /* through the FIFO, threshold full */
    DMA_READS = 1000,           /* a FIFO of four words is empty within a microsecond */

    TICK_HZ = 10000000,
    TICK_NS = 100,
    CAPTURE_1_RISES_2_FALLS = 1 << 0 | 2 << 8, /* both of input 1, */
    CAPTURE_4_RISES = 1 << 8,
    CCER_1_2_4 = 1 << 0 | 3 << 4 | 1 << 12, /* the second inverted */
    EXPOSURE_ENDED = 1 << 2,                /* capture 2 */
    IMU_READY = 1 << 4,                     /* capture 4 */

    TRIGGER_HZ = 10000,   /* what TIM4 counts */
    TRIGGER_PERIOD = 500, /* 50 ms: 20 pictures a second */
    TRIGGER_PULSE = 1,
    /* Of that period: 10 ms exposed and 20 read out at most. Rest begins with the last strip; where none comes,
     * for a picture was left out or cut, it begins then. A sensor takes an exposure in 1 ms. */
    REST_BEGINS = 310,
    EXPOSE_UNTIL = 460,
    PWM_1 = 6 << 4 | 1 << 3,
    TIMER_ON = 1 << 0,
    UPDATE = 1 << 0,

    MOST_STRIP_WORDS = 8 * 376 / 2
};

static volatile uint32_t strips[CAPTURE_BANKS][MOST_STRIP_WORDS] DMA_MEMORY;
static capture *volatile pairs; /* 0: the interrupts leave pictures alone */
static volatile uint32_t triggered;
static volatile bool read_out; /* all strips of the picture that was triggered last are there */
static uint64_t latest_ticks;

/* --- time --- */

const char *moments_start(void) {
    if (!stm32h7_has_crystal()) {
        return "no crystal: the internal oscillator is off by up to a per cent, and so would be "
               "all times";
    }
    latest_ticks = 0;
    TIM2_CR1 = 0;
    TIM2_PSC = stm32h7_timer_hz() / TICK_HZ - 1;
    TIM2_ARR = 0xFFFFFFFFU;
    TIM2_EGR = UPDATE; /* takes the divider over */
    TIM2_CCMR1 = CAPTURE_1_RISES_2_FALLS;
    TIM2_CCMR2 = CAPTURE_4_RISES;
    TIM2_CCER = CCER_1_2_4;
    TIM2_SR = 0;
    TIM2_DIER = EXPOSURE_ENDED | IMU_READY;
    TIM2_CR1 = TIMER_ON;
    return 0;
}

uint64_t moments_now_ns(void) {
    const uint32_t primask = core_irq_save();
    const uint64_t ticks = ticks_extend(&latest_ticks, TIM2_CNT);
    core_irq_restore(primask);
    return ticks * TICK_NS;
}

void moments_isr(void) {
    const uint32_t status = TIM2_SR;
    if ((status & EXPOSURE_ENDED) != 0) {
        const uint32_t middle =
            ticks_middle(TIM2_CCR1, TIM2_CCR2); /* reading CCR2 takes the request back */
        if (pairs != 0) {
            capture_exposed(pairs, ticks_extend(&latest_ticks, middle) * TICK_NS);
        }
    }
    if ((status & IMU_READY) != 0) {
        imu_data_ready(ticks_extend(&latest_ticks, TIM2_CCR4) * TICK_NS);
    }
}

/* --- pictures --- */

/* A stream that is stopped empties its FIFO first. */
static bool stream_stops(void) {
    DMA1_CR(CAMERA_STREAM) &= ~(uint32_t)DMA_EN;
    const bool stopped = stm32h7_waits(&DMA1_CR(CAMERA_STREAM), DMA_EN, 0, DMA_READS);
    DMA1_LIFCR = DMA_FLAGS_0;
    return stopped;
}

/* Everything anew for each picture, so that one that was cut costs itself alone. */
static void arm(void) {
    DCMI_CR = DCMI_SETTINGS; /* off: that empties its own FIFO */
    const bool stopped = stream_stops();
    if (!capture_begin(pairs) || !stopped) {
        return;
    }
    DMA1_PAR(CAMERA_STREAM) = DCMI_DR;
    DMA1_M0AR(CAMERA_STREAM) = (uint32_t)(uintptr_t)strips[0];
    DMA1_M1AR(CAMERA_STREAM) = (uint32_t)(uintptr_t)strips[1];
    DMA1_NDTR(CAMERA_STREAM) = capture_strip_words(pairs);
    DMA1_FCR(CAMERA_STREAM) = DMA_FIFO_FULL;
    DMA1_CR(CAMERA_STREAM) = DMA_TWO_BANKS | DMA_URGENT | DMA_WORDS | DMA_MINC | DMA_TCIE;
    DMA1_CR(CAMERA_STREAM) |= DMA_EN;
    DCMI_ICR = 0x1F;
    DCMI_CR = DCMI_SETTINGS | DCMI_ENABLE;
    DCMI_CR = DCMI_SETTINGS | DCMI_ENABLE | DCMI_CAPTURE;
}

/* The pin EXPOSURE rises with the timer's update; what is exposed is read out at the earliest a row later. */
void camera_trigger_isr(void) {
    TIM4_SR = 0;
    read_out = false;
    ++triggered;
    if (pairs != 0) {
        arm();
    }
}

/* Where the DCMI has lost data the strip is as good as overwritten. */
static unsigned written_now(void) {
    if ((DCMI_RISR & DCMI_OVERRUN) != 0) {
        return capture_bank(pairs);
    }
    return (DMA1_CR(CAMERA_STREAM) & DMA_SECOND_BANK) != 0 ? 1 : 0;
}

void camera_strip_isr(void) {
    const bool full = (DMA1_LISR & DMA_FULL_0) != 0; /* a stream that is stopped interrupts, too */
    DMA1_LIFCR = DMA_FLAGS_0;
    if (full && pairs != 0) {
        capture_strip(pairs, strips[capture_bank(pairs)], written_now);
        read_out = pairs->filling == 0;
    }
}

/* --- both sensors --- */

static void begin_triggers(void) {
    TIM4_PSC = stm32h7_timer_hz() / TRIGGER_HZ - 1;
    TIM4_ARR = TRIGGER_PERIOD - 1;
    TIM4_CCR1 = TRIGGER_PULSE;
    TIM4_CCMR1 = PWM_1;
    TIM4_CCER = 1;
    TIM4_EGR = UPDATE;
    TIM4_SR = 0;
    TIM4_DIER = UPDATE;
    TIM4_CR1 = TIMER_ON;
}

const char *camera_start(capture *into, bool pattern, uint16_t exposure_rows) {
    camera_stop();
    if (capture_strip_words(into) > MOST_STRIP_WORDS) {
        return "strips are longer than their memory";
    }
    stm32h7_cameras_reset(true);
    clock_wait_ms(1);
    stm32h7_cameras_reset(false);
    clock_wait_ms(1);
    stm32h7_i2c_start();
    if (!mt9v034_start(LEFT, pattern, exposure_rows, stm32h7_i2c_write, stm32h7_i2c_read)) {
        return "no MT9V034 answers as the left camera (0x5C on I2C1)";
    }
    if (!mt9v034_start(RIGHT, pattern, exposure_rows, stm32h7_i2c_write, stm32h7_i2c_read)) {
        return "no MT9V034 answers as the right camera (0x48 on I2C1)";
    }
    DMAMUX1_CR(CAMERA_STREAM) = DMA_REQUEST_DCMI;
    compiler_barrier(); /* what the caller has set in it */
    pairs = into;
    begin_triggers();
    return 0;
}

void camera_stop(void) {
    TIM4_CR1 = 0;
    TIM4_DIER = 0;
    pairs = 0;
    read_out = false;
    DCMI_CR = DCMI_SETTINGS;
    (void)stream_stops();
    compiler_barrier(); /* it is the caller's again */
}

/* The counter first: `read_out` is then of the same picture. At 0 the trigger's interrupt may still be to come. */
bool camera_rests(void) {
    const uint32_t since_trigger = TIM4_CNT;
    return since_trigger > 0 && (read_out || since_trigger >= REST_BEGINS) &&
           since_trigger < EXPOSE_UNTIL;
}

uint32_t camera_triggered(void) {
    return triggered;
}

bool camera_expose(camera_side side, uint16_t rows) {
    return mt9v034_expose(side == CAMERA_LEFT ? LEFT : RIGHT, rows, stm32h7_i2c_write);
}
