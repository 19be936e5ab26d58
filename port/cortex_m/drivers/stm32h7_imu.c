// SPDX-License-Identifier: MIT
/*
 * TDK ICM-42688-P at SPI1, 200 readings a second of 2000 deg/s and 16 g. Its line "data ready" is a capture of the
 * timer that stamps the cameras too; the transfer begins in that interrupt and ends in the bus's own: 13 bytes fit
 * into the FIFO, so that nothing waits. Registers: data sheet DS-000347, bank 0; RM0433, section 50.11.
 */
#include "../barrier.h"
#include "../camera.h"
#include "../clock.h"
#include "stm32h7.h"

#define SPI1_CR1  CORE_REGISTER(0x40013000U)
#define SPI1_CR2  CORE_REGISTER(0x40013004U)
#define SPI1_CFG1 CORE_REGISTER(0x40013008U)
#define SPI1_CFG2 CORE_REGISTER(0x4001300CU)
#define SPI1_IER  CORE_REGISTER(0x40013010U)
#define SPI1_SR   CORE_REGISTER(0x40013014U)
#define SPI1_IFCR CORE_REGISTER(0x40013018U)
#define SPI1_TXDR (*(volatile uint8_t *)(uintptr_t)0x40013020U)
#define SPI1_RXDR (*(volatile uint8_t *)(uintptr_t)0x40013030U)

enum {
    CR1_SPE = 1 << 0,
    CR1_CSTART = 1 << 9,
    CR1_SSI = 1 << 12,
    CFG1_8_BITS = 7, /* and the clock by two: 13.3 MHz of the PLL's 26.7 */
    CFG2_MASTER = 1 << 22,
    CFG2_SSM = 1 << 26, /* the select line is a pin of its own */
    SR_ENDED = 1 << 3,
    READS = 100000,

    READ = 0x80,
    DEVICE_CONFIG = 0x11, /* 1: reset */
    INT_CONFIG = 0x14,    /* 3: line 1 is pushed and pulled, a pulse, high */
    DATA = 0x1F,          /* accelerometer, then gyro, the high byte first */
    PWR_MGMT0 = 0x4E,     /* 0xF: both on, low noise */
    GYRO_CONFIG0 = 0x4F,  /* 7: 2000 deg/s, 200 Hz */
    ACCEL_CONFIG0 = 0x50, /* 7: 16 g, 200 Hz */
    INT_CONFIG1 = 0x64,   /* 0: the data sheet asks for it where lines are used */
    INT_SOURCE0 = 0x65,   /* 8: line 1 tells that data is ready */
    WHO_AM_I = 0x75,
    ICM_42688_P = 0x47,

    LENGTH = 13
};

#define CFG2_HOLDS 0x80000000U /* pins stay driven between two transfers */

const double imu_accel_unit = 9.80665 / 2048, imu_gyro_unit = 3.14159265358979323846 / 180 / 16.4;

static readings *volatile queue; /* 0: the interrupts leave readings alone */
static bool busy;
static uint64_t ready_ns;

static void begin(const uint8_t *bytes, unsigned count) {
    stm32h7_imu_select(true);
    SPI1_CR2 = count;
    SPI1_CR1 = CR1_SSI | CR1_SPE;
    for (unsigned i = 0; i < count; ++i) {
        SPI1_TXDR = bytes[i];
    }
    SPI1_CR1 = CR1_SSI | CR1_SPE | CR1_CSTART;
}

static void end(uint8_t *bytes, unsigned count) {
    for (unsigned i = 0; i < count; ++i) {
        bytes[i] = SPI1_RXDR;
    }
    SPI1_IFCR = 0xFF8;
    SPI1_CR1 = CR1_SSI;
    stm32h7_imu_select(false);
}

/* While no line is connected: writes, or reads into the second byte. */
static bool transfers(uint8_t where, uint8_t *byte) {
    uint8_t bytes[2] = {where, *byte};
    begin(bytes, 2);
    const bool ended = stm32h7_waits(&SPI1_SR, SR_ENDED, SR_ENDED, READS);
    end(bytes, 2);
    *byte = bytes[1];
    return ended;
}

static bool sets(uint8_t where, uint8_t value) {
    return transfers(where, &value);
}

const char *imu_start(readings *into) {
    uint8_t who = 0;
    queue = 0;
    compiler_barrier();
    SPI1_IER = 0;
    SPI1_CR1 = CR1_SSI;
    SPI1_CFG1 = CFG1_8_BITS;
    SPI1_CFG2 = CFG2_HOLDS | CFG2_SSM | CFG2_MASTER;
    stm32h7_imu_select(false);
    (void)sets(DEVICE_CONFIG, 1);
    clock_wait_ms(2);
    if (!transfers(WHO_AM_I | READ, &who) || who != ICM_42688_P) {
        return "no ICM-42688-P answers as the IMU (SPI1)";
    }
    bool good = sets(INT_CONFIG, 3) && sets(INT_CONFIG1, 0) && sets(GYRO_CONFIG0, 7) &&
                sets(ACCEL_CONFIG0, 7) && sets(PWR_MGMT0, 0xF);
    clock_wait_ms(50); /* the gyro's start */
    good = good && sets(INT_SOURCE0, 8);
    busy = false;
    compiler_barrier();
    queue = good ? into : 0;
    SPI1_IER = SR_ENDED;
    return good ? 0 : "the IMU stopped to answer (SPI1)";
}

void imu_data_ready(uint64_t t_ns) {
    static const uint8_t ask[LENGTH] = {DATA | READ};
    if (queue == 0) {
        return;
    }
    if (busy) { /* a transfer that did not end within a period: given up */
        SPI1_CR1 = CR1_SSI;
        SPI1_IFCR = 0xFF8;
        stm32h7_imu_select(false);
        ++queue->lost;
    }
    busy = true;
    ready_ns = t_ns;
    begin(ask, LENGTH);
}

static int16_t number(const uint8_t *bytes) {
    return (int16_t)(uint16_t)(bytes[0] << 8 | bytes[1]);
}

void imu_bus_isr(void) {
    uint8_t bytes[LENGTH];
    reading one;
    if ((SPI1_SR & SR_ENDED) == 0) { /* the interrupt of a transfer that was given up */
        return;
    }
    end(bytes, LENGTH);
    if (queue == 0 || !busy) {
        return;
    }
    busy = false;
    one.t_ns = ready_ns;
    for (unsigned i = 0; i < 3; ++i) {
        one.accel[i] = number(bytes + 1 + 2 * i);
        one.gyro[i] = number(bytes + 7 + 2 * i);
    }
    readings_put(queue, &one);
}
