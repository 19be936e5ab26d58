// SPDX-License-Identifier: MIT
/* STM32F405 (RM0090): the link is USART1 on PA9 (out) and PA10 (in), telemetry USART2 on PA2 (out).
 * The clock comes from the
 * internal oscillator, so that the image runs on any board with this part, whatever its crystal. */
#include "../../board.h"

#include <stdbool.h>

#include "../../core.h"
#include "../../drivers/stm32_flash.h"
#include "../../drivers/stm32_iwdg.h"
#include "../../drivers/stm32_usart.h"
#include "../../serial.h"
#include "../../startup.h"

#define RCC_CR      CORE_REGISTER(0x40023800U)
#define RCC_PLLCFGR CORE_REGISTER(0x40023804U)
#define RCC_CFGR    CORE_REGISTER(0x40023808U)
#define RCC_AHB1ENR CORE_REGISTER(0x40023830U)
#define RCC_APB1ENR CORE_REGISTER(0x40023840U)
#define RCC_APB2ENR CORE_REGISTER(0x40023844U)
#define FLASH_ACR   CORE_REGISTER(0x40023C00U)
#define GPIOA_MODER CORE_REGISTER(0x40020000U)
#define GPIOA_PUPDR CORE_REGISTER(0x4002000CU)
#define GPIOA_AFRL  CORE_REGISTER(0x40020020U)
#define GPIOA_AFRH  CORE_REGISTER(0x40020024U)

enum {
    IWDG = 0x40003000,
    HSI_HZ = 16000000,
    PLL_HZ = 168000000,
    APB1_DIVIDER = 4, /* of the PLL's clock: 42 MHz is the most it takes */
    APB2_DIVIDER = 2, /* 84 MHz */
    FALL_BACK_BAUD = 115200,

    RCC_CR_PLLON = 1 << 24,
    RCC_CR_PLLRDY = 1 << 25,
    PLL_FROM_HSI = 16 | 336 << 6 | 0 << 16 | 7 << 24, /* 16 MHz / 16 * 336 / 2 */
    CFGR_BUSES = 5 << 10 | 4 << 13,                   /* APB1 by 4, APB2 by 2 */
    CFGR_SWITCH_PLL = 2,
    CFGR_SWITCHED_PLL = 2 << 2,
    CFGR_SWITCHED = 3 << 2,
    FLASH_FOR_168_MHZ = 5 | 1 << 8 | 1 << 9 | 1 << 10, /* wait states; prefetch and both caches */
    CLOCK_POLLS = 100000, /* the PLL locks within 0.3 ms: under 5000 loops at 16 MHz */

    USART1 = 0x40011000,
    USART2 = 0x40004400,
    IRQ_USART1 = 37,
    IRQ_USART2 = 38,
    INTERRUPTS = 82
};

const char board_name[] = "stm32f405";

__attribute__((section(".vectors"), used))
const vector board_vectors[CORE_EXCEPTIONS + INTERRUPTS] = {
    SYSTEM_VECTORS,
    [CORE_EXCEPTIONS + IRQ_USART1] = serial_link_isr,
    [CORE_EXCEPTIONS + IRQ_USART2] = serial_telemetry_isr,
};

static uint32_t core_hz = HSI_HZ;

static bool wait_for(volatile uint32_t *reg, uint32_t mask, uint32_t value) {
    for (uint32_t poll = 0; poll < CLOCK_POLLS; ++poll) {
        if ((*reg & mask) == value) {
            return true;
        }
    }
    return false;
}

/* 168 MHz, or false and what the part starts with. */
static bool run_from_pll(void) {
    RCC_PLLCFGR = PLL_FROM_HSI;
    RCC_CR |= RCC_CR_PLLON;
    if (!wait_for(&RCC_CR, RCC_CR_PLLRDY, RCC_CR_PLLRDY)) {
        RCC_CR &= ~(uint32_t)RCC_CR_PLLON;
        return false;
    }
    FLASH_ACR = FLASH_FOR_168_MHZ;
    RCC_CFGR = CFGR_BUSES;
    RCC_CFGR = CFGR_BUSES | CFGR_SWITCH_PLL;
    if (!wait_for(&RCC_CFGR, CFGR_SWITCHED, CFGR_SWITCHED_PLL)) {
        RCC_CFGR = 0;
        return false;
    }
    return true;
}

static void connect_pins(void) {
    RCC_AHB1ENR |= 1U << 0;  /* GPIOA */
    RCC_APB2ENR |= 1U << 4;  /* USART1 */
    RCC_APB1ENR |= 1U << 17; /* USART2 */
    (void)RCC_APB1ENR;       /* RM0090 6.2.15: a peripheral is ready two clocks after its enable */
    GPIOA_AFRL = (GPIOA_AFRL & ~0x00000F00U) | 0x00000700U;   /* PA2: function 7 */
    GPIOA_AFRH = (GPIOA_AFRH & ~0x00000FF0U) | 0x00000770U;   /* PA9, PA10: function 7 */
    GPIOA_PUPDR = (GPIOA_PUPDR & ~0x003C0000U) | 0x00100000U; /* PA10 pulled up: idle if open */
    GPIOA_MODER = (GPIOA_MODER & ~0x003C0030U) | 0x00280020U; /* all three: alternate function */
}

void board_init(void) {
    uint32_t apb1_hz = HSI_HZ, apb2_hz = HSI_HZ;
    uint32_t baud = FALL_BACK_BAUD; /* 921600 cannot be made from 16 MHz to better than 2 % */
    if (run_from_pll()) {
        core_hz = PLL_HZ;
        apb1_hz = PLL_HZ / APB1_DIVIDER;
        apb2_hz = PLL_HZ / APB2_DIVIDER;
        baud = BOARD_BAUD;
    }
    connect_pins();
    stm32_usart_start(&serial_link.uart, USART1, apb2_hz, baud);
    stm32_usart_start(&serial_telemetry.uart, USART2, apb1_hz, baud);
    core_enable_irq(IRQ_USART1);
    core_enable_irq(IRQ_USART2);
}

uint32_t board_core_hz(void) {
    return core_hz;
}

/* The independent watchdog runs from its own oscillator of 17 to 47 kHz, 32 as a rule (DS8626):
 * 64 * 2250 of its clocks are 3.1 s at least, 4.5 s as a rule and 8.5 s at most. The least must be
 * more than the 2 s for which an erase of the storage may stop the core. It resets at once; it has no
 * interrupt to report from. */
void board_watchdog_start(void) {
    stm32_iwdg_start(IWDG, 2250);
}

void board_watchdog_feed(void) {
    stm32_iwdg_feed(IWDG);
}

bool board_storage(plr_block_device *device) {
    *device = stm32_flash();
    return true;
}
