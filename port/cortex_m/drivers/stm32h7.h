// SPDX-License-Identifier: MIT
/* What the drivers of the STM32H742/743/753 share: RM0433. */
#ifndef PELORUS_CORTEX_M_STM32H7_H
#define PELORUS_CORTEX_M_STM32H7_H

#include <stdbool.h>
#include <stdint.h>

#include "../core.h"

/* Direct memory access 1 and its multiplexer (chapters 16, 18). Stream 0: cameras, 1: telemetry. */
#define DMA1_LISR         CORE_REGISTER(0x40020000U)
#define DMA1_LIFCR        CORE_REGISTER(0x40020008U)
#define DMA1_CR(stream)   CORE_REGISTER(0x40020010U + 0x18U * (stream))
#define DMA1_NDTR(stream) CORE_REGISTER(0x40020014U + 0x18U * (stream))
#define DMA1_PAR(stream)  CORE_REGISTER(0x40020018U + 0x18U * (stream))
#define DMA1_M0AR(stream) CORE_REGISTER(0x4002001CU + 0x18U * (stream))
#define DMA1_M1AR(stream) CORE_REGISTER(0x40020020U + 0x18U * (stream))
#define DMA1_FCR(stream)  CORE_REGISTER(0x40020024U + 0x18U * (stream))
#define DMAMUX1_CR(line)  CORE_REGISTER(0x40020800U + 4U * (line))

enum {
    CAMERA_STREAM = 0,
    TELEMETRY_STREAM = 1,
    DMA_EN = 1 << 0,
    DMA_TCIE = 1 << 4,
    DMA_TO_PERIPHERAL = 1 << 6,
    DMA_MINC = 1 << 10,
    DMA_WORDS = 2 << 11 | 2 << 13, /* on both sides */
    DMA_URGENT = 3 << 16,
    DMA_TWO_BANKS = 1 << 18,
    DMA_SECOND_BANK = 1 << 19,
    DMA_BUFFERABLE = 1 << 20, /* RM0433 16.3.3: with every UART */
    DMA_FLAGS_0 = 0x3D,       /* all flags of stream 0 */
    DMA_FULL_0 = 1 << 5,      /* of stream 0: all that NDTR said is through */
    DMA_FLAGS_1 = 0x3D << 6
};

/* Memory that a DMA shares with the processor: SRAM3, which board.c takes the cache off. It is not cleared. */
#define DMA_MEMORY __attribute__((section(".dma"), aligned(32)))

/* Whether the register shows the value within so many reads. */
static inline bool stm32h7_waits(volatile uint32_t *at, uint32_t mask, uint32_t value,
                                 uint32_t reads) {
    for (uint32_t i = 0; i < reads; ++i) {
        if ((*at & mask) == value) {
            return true;
        }
    }
    return false;
}

/* Of timers on APB1, Hz, and whether a crystal makes it: board.c. */
uint32_t stm32h7_timer_hz(void);
bool stm32h7_has_crystal(void);

/* Output pins: board.c. */
void stm32h7_cameras_reset(bool on);
void stm32h7_imu_select(bool on);

/* For board.c's vector table. */
void camera_trigger_isr(void); /* TIM4 */
void camera_strip_isr(void);   /* stream 0 */
void moments_isr(void);        /* TIM2 */
void imu_bus_isr(void);        /* SPI1 */

/* The IMU's line rose at that time: begins to read it. */
void imu_data_ready(uint64_t t_ns);

#endif
