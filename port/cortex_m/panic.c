// SPDX-License-Identifier: MIT
#include "panic.h"

#include <string.h>

#include "pelorus/wire.h"
#include "serial.h"

static int send(void *context, const uint8_t *bytes, size_t n) {
    (void)context;
    serial_panic(bytes, n);
    return 0;
}

void panic_text(const char *words) {
    static plr_message message; /* a kilobyte: not for a stack that may be at its end */
    static plr_writer writer;
    const uint8_t delimiter = 0; /* ends the frame that was cut by the fault */
    (void)serial_panic(&delimiter, 1);
    message.kind = PLR_KIND_TEXT;
    message.as.text.severity = PLR_SEVERITY_ERROR;
    strncpy(message.as.text.text, words, PLR_WIRE_MAX_TEXT);
    (void)plr_writer_init(&writer, send, NULL);
    (void)plr_writer_put(&writer, &message);
}
