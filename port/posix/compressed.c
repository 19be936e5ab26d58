// SPDX-License-Identifier: MIT
#include "posix/compressed.h"

#include <string.h>

bool compressed_begins(const uint8_t *bytes, size_t n) {
    static const uint8_t magic[4] = {0x28, 0xB5, 0x2F, 0xFD};
    return n >= sizeof magic && memcmp(bytes, magic, sizeof magic) == 0;
}

bool compressed_is_name(const char *path) {
    const size_t n = strlen(path);
    return n > 4 && strcmp(path + n - 4, ".zst") == 0;
}
