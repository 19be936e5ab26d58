// SPDX-License-Identifier: MIT
/* MPS3 with FPGA image AN547 (DAI 0547): Cortex-M55, an SSE-300. The image runs in the secure state
 * and uses the peripherals' secure addresses. */
#include "../../board.h"
#include "../../core.h"
#include "../../drivers/cmsdk_uart.h"
#include "../../drivers/cmsdk_watchdog.h"
#include "../../drivers/retained_ram.h"
#include "../../serial.h"
#include "../../startup.h"

enum {
    CORE_HZ = 32000000,
    PERIPHERAL_HZ = 25000000,
    SLOW_HZ = 32768,
    UART0 = 0x59303000,
    UART1 = 0x59304000,
    WATCHDOG = 0x5802E000,
    IRQ_UART0_RX = 33,
    IRQ_UART0_TX = 34,
    IRQ_UART1_TX = 36,
    INTERRUPTS = 96
};

const char board_name[] = "mps3_an547";

/* The slow-clock watchdog's interrupt is the NMI: fault_entry reports it and resets the board. */
__attribute__((section(".vectors"), used))
const vector board_vectors[CORE_EXCEPTIONS + INTERRUPTS] = {
    SYSTEM_VECTORS,
    [CORE_EXCEPTIONS + IRQ_UART0_RX] = serial_link_isr,
    [CORE_EXCEPTIONS + IRQ_UART0_TX] = serial_link_isr,
    [CORE_EXCEPTIONS + IRQ_UART1_TX] = serial_telemetry_isr,
};

void board_init(void) {
    cmsdk_uart_start(&serial_link.uart, UART0, PERIPHERAL_HZ, BOARD_BAUD);
    cmsdk_uart_start(&serial_telemetry.uart, UART1, PERIPHERAL_HZ, BOARD_BAUD);
    core_enable_irq(IRQ_UART0_RX);
    core_enable_irq(IRQ_UART0_TX);
    core_enable_irq(IRQ_UART1_TX);
}

uint32_t board_core_hz(void) {
    return CORE_HZ;
}

void board_watchdog_start(void) {
    cmsdk_watchdog_start(WATCHDOG, 2U * SLOW_HZ);
}

void board_watchdog_feed(void) {
    cmsdk_watchdog_feed(WATCHDOG);
}

bool board_storage(plr_block_device *device) {
    *device = retained_ram();
    return true;
}
