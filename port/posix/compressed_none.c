// SPDX-License-Identifier: MIT
/* CMake takes this file where there is no libzstd. */
#include <stddef.h>

#include "posix/compressed.h"

bool compressed_is_built_in(void) {
    return false;
}

compressed_input *compressed_input_open(compressed_fetch fetch, void *context) {
    (void)fetch;
    (void)context;
    return NULL;
}

long compressed_input_read(compressed_input *in, uint8_t *bytes, size_t n) {
    (void)in;
    (void)bytes;
    (void)n;
    return COMPRESSED_FAILED;
}

void compressed_input_close(compressed_input *in) {
    (void)in;
}

compressed_output *compressed_output_open(FILE *file) {
    (void)file;
    return NULL;
}

bool compressed_output_write(compressed_output *out, const uint8_t *bytes, size_t n) {
    (void)out;
    (void)bytes;
    (void)n;
    return false;
}

bool compressed_output_close(compressed_output *out) {
    return out == NULL;
}
