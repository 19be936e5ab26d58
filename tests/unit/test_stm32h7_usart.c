// SPDX-License-Identifier: MIT
/* The STM32H7's USART that sends by DMA, against a model of a stream (RM0433, chapter 16): blocks go out one by one,
 * whole and in order, and the one that is under way is not written. No emulator has it. */
#include <stdbool.h>
#include <string.h>
#include <unity.h>

/* The driver's own include of this is then empty. */
#define PELORUS_CORTEX_M_CORE_H
#define CORE_REGISTER(address) (*model_register(address))

#include <stdint.h>

static volatile uint32_t *model_register(uint32_t address);

static void core_write_barrier(void) {
}

#include "../../port/cortex_m/drivers/stm32h7_usart.c"

enum {
    DMA1 = 0x40020000,
    DMAMUX1 = 0x40020800,
    REGISTERS = 0x1000 / 4,
    SENT = 16384,
    REQUEST = 44
};

static struct {
    volatile uint32_t registers[REGISTERS];
    volatile uint32_t usart[16];
    uint8_t block[BLOCK], sent[SENT];
    const volatile uint8_t *memory;
    unsigned count, length;
    bool running;
} part;

static uart port;

static volatile uint32_t *model_register(uint32_t address) {
    TEST_ASSERT_TRUE(address >= DMA1 && address < DMA1 + sizeof part.registers);
    return &part.registers[(address - DMA1) / 4];
}

void setUp(void) {
    memset(&part, 0, sizeof part);
    stm32h7_usart_start_sender(&port, (uintptr_t)part.usart, 120000000, 921600, REQUEST);
}

/* What the hardware does when EN was set: it remembers where, and how many. */
static void begin(void) {
    if (part.running || (DMA1_CR(TELEMETRY_STREAM) & DMA_EN) == 0)
        return;
    part.running = true;
    part.count = DMA1_NDTR(TELEMETRY_STREAM);
    TEST_ASSERT_TRUE(part.count > 0 && part.count <= BLOCK);
    const uint32_t where = DMA1_M0AR(TELEMETRY_STREAM);
    const bool second = where == (uint32_t)(uintptr_t)blocks[1];
    TEST_ASSERT_TRUE(second || where == (uint32_t)(uintptr_t)blocks[0]);
    part.memory = blocks[second];
    for (unsigned i = 0; i < part.count; i++)
        part.block[i] = part.memory[i];
}

/* The last byte is through: the driver's interrupt. What was sent must still be what it was at the start. */
static void finish(void) {
    TEST_ASSERT_TRUE(part.running);
    for (unsigned i = 0; i < part.count; i++) {
        TEST_ASSERT_EQUAL_HEX8(part.block[i], part.memory[i]);
        part.sent[part.length++] = part.block[i];
    }
    part.running = false;
    DMA1_CR(TELEMETRY_STREAM) &= ~(uint32_t)DMA_EN;
    uart_acknowledge(&port);
}

/* As serial.c does: gives what is taken, then asks for the interrupt. Returns how many were taken. */
static unsigned give(unsigned first, unsigned count) {
    unsigned taken = 0;
    while (taken < count && uart_give(&port, (uint8_t)((first + taken) * 7)))
        taken++;
    uart_transmit_irq(&port, taken < count);
    begin();
    return taken;
}

static void assert_sent(unsigned count) {
    TEST_ASSERT_EQUAL_UINT(count, part.length);
    for (unsigned i = 0; i < count; i++)
        TEST_ASSERT_EQUAL_HEX8((uint8_t)(i * 7), part.sent[i]);
}

static void test_the_stream_is_set_up_for_this_usart(void) {
    TEST_ASSERT_EQUAL_UINT32(REQUEST, DMAMUX1_CR(TELEMETRY_STREAM));
    TEST_ASSERT_EQUAL_HEX32((uint32_t)((uintptr_t)part.usart + 0x28), DMA1_PAR(TELEMETRY_STREAM));
    TEST_ASSERT_EQUAL_HEX32(0x80, part.usart[2]); /* CR3: DMAT */
    TEST_ASSERT_EQUAL_HEX32(0x9, part.usart[0]);  /* CR1: TE, UE; no receiver */
    TEST_ASSERT_EQUAL_UINT32(130, part.usart[3]); /* 120 MHz / 921600 = 130.2 */
}

static void test_a_single_byte_goes_out_without_another(void) {
    give(0, 1);
    TEST_ASSERT_EQUAL_HEX32(DMA_BUFFERABLE | DMA_MINC | DMA_TO_PERIPHERAL | DMA_TCIE | DMA_EN,
                            DMA1_CR(TELEMETRY_STREAM));
    finish();
    give(1, 0);
    TEST_ASSERT_FALSE(part.running);
    assert_sent(1);
}

static void test_what_comes_while_a_block_is_under_way_is_the_next_one(void) {
    unsigned given = give(0, 3);
    given += give(given, 100);
    given += give(given, 5);
    finish();
    give(given, 0); /* the interrupt, with nothing new */
    TEST_ASSERT_EQUAL_UINT(105, part.count);
    finish();
    assert_sent(given);
}

static void test_full_blocks_are_refused_and_nothing_is_lost_or_doubled(void) {
    unsigned given = 0, refused = 0;
    for (unsigned round = 0; round < 60; round++) {
        const unsigned wanted = round * 37 % 300, taken = give(given, wanted);
        refused += taken < wanted;
        given += taken;
        if (round % 3 == 2 && part.running) {
            finish();
            given += give(given, 1);
        }
    }
    TEST_ASSERT_TRUE(refused > 5);
    while (part.running) {
        finish();
        give(given, 0);
    }
    assert_sent(given);
}

static void test_a_usart_without_dma_is_asked_for_its_own_state(void) {
    uint32_t registers[16] = {0};
    uart other;
    uint8_t byte = 0;
    stm32h7_usart_start(&other, (uintptr_t)registers, 120000000, 921600);
    TEST_ASSERT_EQUAL_HEX32(1U << 29 | 0xD, registers[0]); /* FIFOs, receiver and transmitter */
    TEST_ASSERT_FALSE(uart_give(&other, 5));
    TEST_ASSERT_FALSE(uart_take(&other, &byte));
    registers[7] = 1U << 7 | 1U << 5; /* ISR: room, and a byte */
    registers[9] = 0x41;
    TEST_ASSERT_TRUE(uart_give(&other, 0x42));
    TEST_ASSERT_EQUAL_HEX32(0x42, registers[10]);
    TEST_ASSERT_TRUE(uart_take(&other, &byte));
    TEST_ASSERT_EQUAL_HEX8(0x41, byte);
    uart_transmit_irq(&other, true);
    TEST_ASSERT_EQUAL_HEX32(5U << 29 | 1U << 23, registers[2]);
    uart_receive_irq(&other, true);
    TEST_ASSERT_EQUAL_HEX32(1U << 29 | 0x2D, registers[0]);
    registers[7] = 1U << 3; /* overrun */
    TEST_ASSERT_FALSE(uart_take(&other, &byte));
    TEST_ASSERT_EQUAL_UINT32(1, other.overruns);
    TEST_ASSERT_EQUAL_HEX32(1U << 3, registers[8]);
}
