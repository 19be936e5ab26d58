// SPDX-License-Identifier: MIT
/*
 * The first image for a new board: no filter, only what it needs. It reads lines of text from the
 * link and answers each with one. Type `hello`: an answer shows that startup, clock, UART and
 * interrupts work. The other words test what is hard to test later: docs/PORTING.md.
 */
#include <string.h>

#include "board.h"
#include "clock.h"
#include "core.h"
#include "fault.h"
#include "pelorus/config.h"
#include "serial.h"
#include "startup.h"
#include "text.h"

static text answer;

static void send_answer(void) {
    text_add(&answer, "\n");
    while (!serial_write(&serial_link, (const uint8_t *)answer.characters, answer.length)) {
        serial_sleep();
    }
}

static void say_hello(void) {
    text_add(&answer, "hello from ");
    text_add(&answer, board_name);
    text_add(&answer, ": ");
    fault_add_history(&answer);
}

static void say_time(void) {
    text_add(&answer, "ns ");
    text_add_number(&answer, clock_ns());
}

static void say_stack(void) {
    text_add(&answer, "stack ");
    text_add_number(&answer, stack_used());
    text_add(&answer, " of ");
    text_add_number(&answer, stack_size());
}

/* (1 + 2^-12)^2 minus the same product rounded to float: 2^-24 if multiply and add are fused, else
 * 0. */
static void say_fused(void) {
    volatile float a = 1.0F + 0x1p-12F;
    volatile float c = -(1.0F + 0x1p-11F);
    const float left = PLR_FMA(a, a, c);
    text_add(&answer, left == 0x1p-24F ? "fused yes" : "fused NO");
}

static void fault_by_instruction(void) {
    __asm volatile("udf #0");
}

/* A stack used to its last word, and one word more. */
static void fault_by_stack(void) {
    __asm volatile("ldr r0, =_stack_bottom \n"
                   "mov sp, r0             \n"
                   "push {r4-r11}          \n" ::
                       : "r0", "memory");
}

static void hang(void) {
    core_irq_off();
    for (;;) {
    }
}

typedef struct command {
    const char *word;
    void (*run)(void);
} command;

static const command commands[] = {
    {"hello", say_hello},
    {"time", say_time},
    {"stack", say_stack},
    {"fused", say_fused},
    {"fault", fault_by_instruction},
    {"overflow", fault_by_stack},
    {"hang", hang},
};

static void obey(const char *line) {
    text_clear(&answer);
    for (size_t i = 0; i < sizeof commands / sizeof commands[0]; ++i) {
        if (strcmp(line, commands[i].word) == 0) {
            commands[i].run();
            send_answer();
            return;
        }
    }
    text_add(&answer, "echo ");
    text_add(&answer, line);
    send_answer();
}

int main(void) {
    char line[128];
    size_t length = 0;
    board_init();
    clock_start(board_core_hz());
    serial_start(&serial_link);
    board_watchdog_start();
    core_irq_on();
    obey("hello");
    for (;;) {
        uint8_t byte;
        board_watchdog_feed();
        if (serial_read(&serial_link, &byte, 1) == 0) {
            serial_sleep();
        } else if (byte == '\n') {
            line[length] = '\0';
            obey(line);
            length = 0;
        } else if (length + 1 < sizeof line) {
            line[length++] = (char)byte;
        }
    }
}
