// SPDX-License-Identifier: MIT
/* RM0433, section 47.7. */
#include "stm32h7_i2c.h"

#include "stm32h7.h"

#define I2C1_CR1     CORE_REGISTER(0x40005400U)
#define I2C1_CR2     CORE_REGISTER(0x40005404U)
#define I2C1_TIMINGR CORE_REGISTER(0x40005410U)
#define I2C1_ISR     CORE_REGISTER(0x40005418U)
#define I2C1_ICR     CORE_REGISTER(0x4000541CU)
#define I2C1_RXDR    CORE_REGISTER(0x40005424U)
#define I2C1_TXDR    CORE_REGISTER(0x40005428U)

enum {
    CR1_PE = 1 << 0,
    CR2_READ = 1 << 10,
    CR2_START = 1 << 13,
    CR2_COUNT = 16,
    CR2_AUTOEND = 1 << 25,
    ISR_TXIS = 1 << 1,
    ISR_RXNE = 1 << 2,
    ISR_NACKF = 1 << 4,
    ISR_STOPF = 1 << 5,
    ISR_TC = 1 << 6,
    ICR_ALL = 0x3F38,
    READS =
        200000 /* of a register, some 20 ns each: a byte takes 0.1 ms, and a sensor may hold the clock */
};

/* Of 120 MHz: divided by 12; 5 us low, 4 us high, 1 us before and 0.5 us after the clock's edge. */
#define TIMING (11U << 28 | 9U << 20 | 5U << 16 | 39U << 8 | 49U)

void stm32h7_i2c_start(void) {
    I2C1_CR1 = 0;
    I2C1_TIMINGR = TIMING;
    I2C1_CR1 = CR1_PE;
}

/* Waits for that flag; false if the device refuses, or time is up. */
static bool comes(uint32_t flag) {
    for (uint32_t i = 0; i < READS; ++i) {
        const uint32_t status = I2C1_ISR;
        if ((status & ISR_NACKF) != 0) {
            return false;
        }
        if ((status & flag) != 0) {
            return true;
        }
    }
    return false;
}

/* A transfer that failed leaves the peripheral anywhere: PE off and on takes it back. */
static bool ends(bool good) {
    good = good && comes(ISR_STOPF);
    if (!good) {
        I2C1_CR1 = 0;
        (void)I2C1_CR1;
        (void)I2C1_CR1;
        (void)I2C1_CR1; /* RM0433 47.4.6: three clocks of the bus */
        I2C1_CR1 = CR1_PE;
    }
    I2C1_ICR = ICR_ALL;
    return good;
}

static void begin(uint8_t device, uint32_t count, uint32_t flags) {
    I2C1_ICR = ICR_ALL;
    I2C1_CR2 = (uint32_t)device << 1 | count << CR2_COUNT | flags | CR2_START;
}

static bool sends(uint8_t byte) {
    if (!comes(ISR_TXIS)) {
        return false;
    }
    I2C1_TXDR = byte;
    return true;
}

bool stm32h7_i2c_write(uint8_t device, uint8_t where, uint16_t value) {
    begin(device, 3, CR2_AUTOEND);
    return ends(sends(where) && sends((uint8_t)(value >> 8)) && sends((uint8_t)value));
}

bool stm32h7_i2c_read(uint8_t device, uint8_t where, uint16_t *value) {
    begin(device, 1, 0);
    bool good = sends(where) && comes(ISR_TC);
    if (good) {
        begin(device, 2, CR2_READ | CR2_AUTOEND);
        good = comes(ISR_RXNE);
        const uint32_t high = I2C1_RXDR;
        good = good && comes(ISR_RXNE);
        *value = (uint16_t)(high << 8 | (I2C1_RXDR & 0xFFU));
    }
    return ends(good);
}
