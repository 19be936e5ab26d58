// SPDX-License-Identifier: MIT
/* I2C1 as master, 100 kHz, by polling: for settings of sensors, 0.4 ms each. Bounded. */
#ifndef PELORUS_CORTEX_M_STM32H7_I2C_H
#define PELORUS_CORTEX_M_STM32H7_I2C_H

#include <stdbool.h>
#include <stdint.h>

void stm32h7_i2c_start(void);

/* A register of 16 bits, the high byte first. False: no answer. */
bool stm32h7_i2c_write(uint8_t device, uint8_t where, uint16_t value);
bool stm32h7_i2c_read(uint8_t device, uint8_t where, uint16_t *value);

#endif
