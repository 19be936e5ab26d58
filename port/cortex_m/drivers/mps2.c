// SPDX-License-Identifier: MIT
/* Arm's MPS2 boards with a "Cortex-M prototyping" FPGA image (AN386, AN500): clock, UARTs and
 * watchdog are the same in all of them (DAI 0386 and DAI 0500, tables of memory and interrupts). */
#include "../board.h"
#include "../core.h"
#include "../serial.h"
#include "../startup.h"
#include "cmsdk_uart.h"
#include "cmsdk_watchdog.h"
#include "retained_ram.h"

enum {
    CORE_HZ = 25000000,
    UART0 = 0x40004000,
    UART1 = 0x40005000,
    WATCHDOG = 0x40008000,
    IRQ_UART0_RX = 0,
    IRQ_UART0_TX = 1,
    IRQ_UART1_TX = 3,
    INTERRUPTS = 32
};

/* The watchdog's interrupt is the NMI: fault_entry reports it and resets the board. */
__attribute__((section(".vectors"), used))
const vector board_vectors[CORE_EXCEPTIONS + INTERRUPTS] = {
    SYSTEM_VECTORS,
    [CORE_EXCEPTIONS + IRQ_UART0_RX] = serial_link_isr,
    [CORE_EXCEPTIONS + IRQ_UART0_TX] = serial_link_isr,
    [CORE_EXCEPTIONS + IRQ_UART1_TX] = serial_telemetry_isr,
};

void board_init(void) {
    cmsdk_uart_start(&serial_link.uart, UART0, CORE_HZ, BOARD_BAUD);
    cmsdk_uart_start(&serial_telemetry.uart, UART1, CORE_HZ, BOARD_BAUD);
    core_enable_irq(IRQ_UART0_RX);
    core_enable_irq(IRQ_UART0_TX);
    core_enable_irq(IRQ_UART1_TX);
}

uint32_t board_core_hz(void) {
    return CORE_HZ;
}

void board_watchdog_start(void) {
    cmsdk_watchdog_start(WATCHDOG, 2U * CORE_HZ);
}

void board_watchdog_feed(void) {
    cmsdk_watchdog_feed(WATCHDOG);
}

bool board_storage(plr_block_device *device) {
    *device = retained_ram();
    return true;
}
