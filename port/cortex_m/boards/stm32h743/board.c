// SPDX-License-Identifier: MIT
/*
 * ST NUCLEO-H743ZI2 (RM0433; UM2407): the link is USART3, which the board's probe shows as a serial port (PD8 out,
 * PD9 in), telemetry USART2 on PD5 (out). Two MT9V034 and an ICM-42688-P: pins[] and docs/PORTING.md have the wires.
 *
 * 480 MHz from the probe's crystal; 400 MHz on silicon before revision V. Without that clock the internal oscillator
 * does, for the link: then the cameras are not started.
 */
#include "../../board.h"

#include "../../core.h"
#include "../../drivers/stm32_iwdg.h"
#include "../../drivers/stm32h7.h"
#include "../../drivers/stm32h7_usart.h"
#include "../../serial.h"
#include "../../startup.h"

#define RCC_CR        CORE_REGISTER(0x58024400U)
#define RCC_CFGR      CORE_REGISTER(0x58024410U)
#define RCC_D1CFGR    CORE_REGISTER(0x58024418U)
#define RCC_D2CFGR    CORE_REGISTER(0x5802441CU)
#define RCC_D3CFGR    CORE_REGISTER(0x58024420U)
#define RCC_PLLCKSELR CORE_REGISTER(0x58024428U)
#define RCC_PLLCFGR   CORE_REGISTER(0x5802442CU)
#define RCC_PLL1DIVR  CORE_REGISTER(0x58024430U)
#define RCC_AHB1ENR   CORE_REGISTER(0x580244D8U)
#define RCC_AHB2ENR   CORE_REGISTER(0x580244DCU)
#define RCC_AHB4ENR   CORE_REGISTER(0x580244E0U)
#define RCC_APB1LENR  CORE_REGISTER(0x580244E8U)
#define RCC_APB2ENR   CORE_REGISTER(0x580244F0U)
#define RCC_APB4ENR   CORE_REGISTER(0x580244F4U)
#define PWR_CSR1      CORE_REGISTER(0x58024804U)
#define PWR_CR3       CORE_REGISTER(0x5802480CU)
#define PWR_D3CR      CORE_REGISTER(0x58024818U)
#define SYSCFG_PWRCR  CORE_REGISTER(0x5800042CU)
#define FLASH_ACR     CORE_REGISTER(0x52002000U)
#define DBGMCU_IDC    CORE_REGISTER(0x5C001000U)
/* Of AXI SRAM's port: how it takes reads. */
#define AXI_TARG7_FN_MOD CORE_REGISTER(0x51008108U)

#define GPIO(port, offset) CORE_REGISTER(0x58020000U + 0x400U * (port) + (offset))

#define SCB_CCSIDR  CORE_REGISTER(0xE000ED80U)
#define SCB_CSSELR  CORE_REGISTER(0xE000ED84U)
#define SCB_ICIALLU CORE_REGISTER(0xE000EF50U)
#define SCB_DCISW   CORE_REGISTER(0xE000EF60U)

enum {
    IWDG = 0x58004800,
    HSI_HZ = 64000000,
    REVISION_V = 0x2003, /* in the upper half of DBGMCU_IDC */

    CR_HSEON = 1 << 16,
    CR_HSERDY = 1 << 17,
    CR_HSEBYP = 1 << 18, /* a clock, not a crystal, at the pin: MCO of the board's probe, 8 MHz */
    CR_PLL1ON = 1 << 24,
    CR_PLL1RDY = 1 << 25,
    CKSELR_HSE = 2 | 1 << 4, /* by 1 */
    CKSELR_HSI = 0 | 8 << 4, /* by 8: 8 MHz, too */
    PLLCFGR_8_MHZ =
        3 << 2 | 1 << 16 | 1 << 17, /* 8 to 16 MHz in, the wide range out, dividers P and Q */
    CFGR_PLL = 3,
    CFGR_PLL_IS_ON = 3 << 3,
    CFGR_SWITCHED = 7 << 3,
    CFGR_MCO1_PLL_Q = 3 << 22 | 1 << 18,
    D1_BUS_BY_2 = 8 | 4 << 4,      /* AXI and AHB; APB3 by 2 again */
    D2_BUS_BY_2 = 4 << 4 | 4 << 8, /* APB1, APB2 */
    D3_BUS_BY_2 = 4 << 4,          /* APB4 */

    CR3_LDO = 1 << 1, /* with the lock bit of the low byte, once after power-up */
    CSR1_ACTVOSRDY = 1 << 13,
    D3CR_VOS1 = 3 << 14,
    D3CR_VOSRDY = 1 << 13,
    PWRCR_ODEN = 1,                 /* VOS1 becomes VOS0 */
    FLASH_FOR_240_MHZ = 4 | 2 << 4, /* wait states, and the delay of programming */
    POLLS = 200000,

    A = 0,
    B,
    C,
    D,
    E,
    F,
    G,
    OUT = 16,  /* no alternate function: an output that is low */
    OPEN = 32, /* open drain, with pull-up */

    USART2 = 0x40004400,
    USART3 = 0x40004800,
    DMA_REQUEST_USART2_TX = 44,
    IRQ_DMA1_0 = 11,
    IRQ_DMA1_1 = 12,
    IRQ_TIM2 = 28,
    IRQ_TIM4 = 30,
    IRQ_SPI1 = 35,
    IRQ_USART3 = 39,
    INTERRUPTS = 150
};

const char board_name[] = "stm32h743";

__attribute__((section(".vectors"), used))
const vector board_vectors[CORE_EXCEPTIONS + INTERRUPTS] = {
    SYSTEM_VECTORS,
    [CORE_EXCEPTIONS + IRQ_DMA1_0] = camera_strip_isr,
    [CORE_EXCEPTIONS + IRQ_DMA1_1] = serial_telemetry_isr,
    [CORE_EXCEPTIONS + IRQ_TIM2] = moments_isr,
    [CORE_EXCEPTIONS + IRQ_TIM4] = camera_trigger_isr,
    [CORE_EXCEPTIONS + IRQ_SPI1] = imu_bus_isr,
    [CORE_EXCEPTIONS + IRQ_USART3] = serial_link_isr,
};

/* Port, pin, alternate function (data sheet DS12110, tables 9 to 19). */
static const struct {
    uint8_t port, number, function;
} pins[] = {
    {A, 0, 1},   /* exposure in: LED_OUT of the left camera */
    {D, 12, 2},  /* trigger out: EXPOSURE of both */
    {A, 8, 0},   /* clock out: SYSCLK of both, 26.7 MHz */
    {G, 0, OUT}, /* RESET_BAR of both */
    {A, 6, 13},       {A, 4, 13},
    {G, 9, 13}, /* PIXCLK, LINE_VALID, FRAME_VALID of the left */
    {C, 6, 13},       {C, 7, 13},
    {C, 8, 13},       {C, 9, 13}, /* DOUT3 to DOUT6 of the left, */
    {E, 4, 13},       {D, 3, 13},
    {E, 5, 13}, /* and DOUT7 to DOUT9 */
    {E, 6, 13},       {C, 10, 13},
    {C, 12, 13},      {D, 6, 13}, /* the same of the right */
    {D, 2, 13},       {F, 11, 13},
    {G, 15, 13},      {B, 8, 4 | OPEN},
    {B, 9, 4 | OPEN}, /* I2C1: clock and data of both */
    {B, 3, 5},        {B, 4, 5},
    {B, 5, 5},        {A, 15, OUT}, /* the IMU: clock, out, in (SPI1), select, */
    {A, 3, 1},                      /* and data ready */
    {D, 8, 7},        {D, 9, 7},
    {D, 5, 7}, /* the UARTs */
};

static uint32_t core_hz = HSI_HZ;
static bool has_crystal;

/* --- clocks --- */

static bool waits(volatile uint32_t *at, uint32_t mask, uint32_t value) {
    return stm32h7_waits(at, mask, value, POLLS);
}

/* The core's voltage for 400 MHz, and on revision V for 480. */
static bool raises_voltage(bool fast) {
    PWR_CR3 = (PWR_CR3 & ~7U) | CR3_LDO;
    if (!waits(&PWR_CSR1, CSR1_ACTVOSRDY, CSR1_ACTVOSRDY)) {
        return false;
    }
    PWR_D3CR = D3CR_VOS1;
    if (!waits(&PWR_D3CR, D3CR_VOSRDY, D3CR_VOSRDY)) {
        return false;
    }
    if (fast) {
        RCC_APB4ENR |= 1U << 1; /* SYSCFG */
        (void)RCC_APB4ENR;
        SYSCFG_PWRCR |= PWRCR_ODEN;
        (void)SYSCFG_PWRCR;
    }
    return waits(&PWR_D3CR, D3CR_VOSRDY, D3CR_VOSRDY);
}

/* PLL 1: 8 MHz by 120 or 100; half of it for the core, and 26.7 MHz for cameras and IMU. */
static bool runs_from_pll(bool fast) {
    const uint32_t times = fast ? 120 : 100, by_q = fast ? 36 : 30;
    RCC_CR |= CR_HSEBYP;
    RCC_CR |= CR_HSEON;
    has_crystal = waits(&RCC_CR, CR_HSERDY, CR_HSERDY);
    RCC_PLLCKSELR = has_crystal ? CKSELR_HSE : CKSELR_HSI;
    RCC_PLLCFGR = PLLCFGR_8_MHZ;
    RCC_PLL1DIVR = (times - 1) | (2U - 1) << 9 | (by_q - 1) << 16;
    RCC_CR |= CR_PLL1ON;
    if (!waits(&RCC_CR, CR_PLL1RDY, CR_PLL1RDY)) {
        return false;
    }
    FLASH_ACR = FLASH_FOR_240_MHZ;
    if (!waits(&FLASH_ACR, 0x3F, FLASH_FOR_240_MHZ)) {
        return false;
    }
    RCC_D1CFGR = D1_BUS_BY_2;
    RCC_D2CFGR = D2_BUS_BY_2;
    RCC_D3CFGR = D3_BUS_BY_2;
    RCC_CFGR = CFGR_MCO1_PLL_Q | CFGR_PLL;
    return waits(&RCC_CFGR, CFGR_SWITCHED, CFGR_PLL_IS_ON);
}

/* The peripherals' buses and their UARTs run at a quarter of the core's clock, their timers at half. What the part
 * starts with: everything at 64 MHz. */
static uint32_t start_clocks(void) {
    const bool fast = DBGMCU_IDC >> 16 == REVISION_V;
    if (raises_voltage(fast) && runs_from_pll(fast)) {
        core_hz = fast ? 480000000 : 400000000;
        return core_hz / 4;
    }
    has_crystal = false;
    RCC_CFGR = 0;
    RCC_D1CFGR = RCC_D2CFGR = RCC_D3CFGR = 0;
    return HSI_HZ;
}

uint32_t stm32h7_timer_hz(void) {
    return core_hz == HSI_HZ ? HSI_HZ : core_hz / 2;
}

bool stm32h7_has_crystal(void) {
    return has_crystal;
}

/* --- memory --- */

extern uint8_t _dma_start[]; /* from dma.ld: SRAM3 */

static void set_region(uint32_t number, uint32_t base, uint32_t attributes) {
    MPU_RNR = number;
    MPU_RBAR = base;
    MPU_RASR = attributes;
}

/* Beside the stack's guard (region 0, stack_guard_mpu.c). What a DMA writes is not cached, so that no line needs to
 * be thrown away. Where no memory is (FMC, QUADSPI: 0x60000000 to 0x9FFFFFFF) nobody may look ahead: a read that a
 * controller does not answer would stop the core. */
static void set_regions(void) {
    enum {
        ENABLE = 1,
        SIZE_32_KB = 14 << 1,
        SIZE_512_MB = 28 << 1,
        NOT_CACHED = 1 << 19 | 1 << 18, /* normal memory, shared */
        FOR_ALL = 3 << 24,
        NO_EXECUTE = 1 << 28
    };
    set_region(1, (uint32_t)(uintptr_t)_dma_start,
               NO_EXECUTE | FOR_ALL | NOT_CACHED | SIZE_32_KB | ENABLE);
    set_region(2, 0x60000000U, NO_EXECUTE | SIZE_512_MB | ENABLE);
    set_region(3, 0x80000000U, NO_EXECUTE | SIZE_512_MB | ENABLE);
    __asm volatile("dsb\n\tisb" ::: "memory");
}

/* After a reset the caches hold anything: each line is thrown away before they are switched on. */
static void start_caches(void) {
    enum { WAYS = 4, WAY = 30, SET = 5, CCR_DATA = 1 << 16, CCR_INSTRUCTIONS = 1 << 17 };
    SCB_ICIALLU = 0;
    SCB_CSSELR = 0; /* the data cache */
    core_write_barrier();
    const uint32_t sets = (SCB_CCSIDR >> 13 & 0x7FFFU) + 1;
    for (uint32_t set = 0; set < sets; ++set) {
        for (uint32_t way = 0; way < WAYS; ++way) {
            SCB_DCISW = way << WAY | set << SET;
        }
    }
    core_write_barrier();
    SCB_CCR |= CCR_DATA | CCR_INSTRUCTIONS;
    __asm volatile("dsb\n\tisb" ::: "memory");
}

/* --- pins --- */

static void set_bits(volatile uint32_t *at, uint32_t mask, unsigned shift, uint32_t value) {
    *at = (*at & ~(mask << shift)) | value << shift;
}

static void connect(unsigned port, unsigned number, unsigned function) {
    enum { MODER = 0x00, OTYPER = 0x04, OSPEEDR = 0x08, PUPDR = 0x0C, AFRL = 0x20 };
    const unsigned nibble = 4 * (number % 8);
    set_bits(&GPIO(port, AFRL + number / 8 * 4), 15, nibble, function & 15U);
    set_bits(&GPIO(port, OTYPER), 1, number, (function & OPEN) != 0);
    set_bits(&GPIO(port, PUPDR), 3, 2 * number, (function & OPEN) != 0);
    set_bits(&GPIO(port, OSPEEDR), 3, 2 * number, 2); /* high: some 100 MHz */
    set_bits(&GPIO(port, MODER), 3, 2 * number, (function & OUT) != 0 ? 1 : 2);
}

static void put(unsigned port, unsigned number, bool high) {
    enum { BSRR = 0x18 };
    GPIO(port, BSRR) = 1U << (number + (high ? 0 : 16));
}

void stm32h7_cameras_reset(bool on) {
    put(G, 0, !on);
}

void stm32h7_imu_select(bool on) {
    put(A, 15, !on);
}

static void switch_peripherals_on(void) {
    RCC_AHB4ENR |= 0x7FU;              /* GPIOA to GPIOG */
    RCC_AHB1ENR |= 1U << 0;            /* DMA1 */
    RCC_AHB2ENR |= 1U << 0 | 7U << 29; /* DCMI; SRAM1 to SRAM3 */
    RCC_APB1LENR |=
        1U << 0 | 1U << 2 | 1U << 17 | 1U << 18 | 1U << 21; /* TIM2, TIM4, USART2, USART3, I2C1 */
    RCC_APB2ENR |= 1U << 12;                                /* SPI1 */
    (void)RCC_APB2ENR;
    core_write_barrier();
}

void board_init(void) {
    /* Revision Y: reads of AXI SRAM one by one, for they may be corrupt otherwise (ES0392). */
    if (DBGMCU_IDC >> 16 < 0x2000) {
        AXI_TARG7_FN_MOD = 1;
    }
    const uint32_t apb_hz = start_clocks();
    switch_peripherals_on();
    set_regions();
    start_caches();
    stm32h7_imu_select(false);
    for (unsigned i = 0; i < sizeof pins / sizeof pins[0]; ++i) {
        connect(pins[i].port, pins[i].number, pins[i].function);
    }
    stm32h7_usart_start(&serial_link.uart, USART3, apb_hz, BOARD_BAUD);
    stm32h7_usart_start_sender(&serial_telemetry.uart, USART2, apb_hz, BOARD_BAUD,
                               DMA_REQUEST_USART2_TX);
    core_enable_irq(IRQ_USART3);
    core_enable_irq(IRQ_DMA1_0);
    core_enable_irq(IRQ_DMA1_1);
    core_enable_irq(IRQ_TIM2);
    core_enable_irq(IRQ_TIM4);
    core_enable_irq(IRQ_SPI1);
}

uint32_t board_core_hz(void) {
    return core_hz;
}

/* The independent watchdog runs from its own oscillator of some 32 kHz: 64 * 1000 of its clocks are 2 s. */
void board_watchdog_start(void) {
    stm32_iwdg_start(IWDG, 1000);
}

void board_watchdog_feed(void) {
    stm32_iwdg_feed(IWDG);
}

bool board_storage(plr_block_device *device) {
    (void)device;
    return false;
}
