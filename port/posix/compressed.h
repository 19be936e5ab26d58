// SPDX-License-Identifier: MIT
/* Files compressed by zstd (.zst), by libzstd where CMake found it (compressed_zstd.c); else
 * compressed_none.c, which has none of it. */
#ifndef PELORUS_POSIX_COMPRESSED_H
#define PELORUS_POSIX_COMPRESSED_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

/* Was libzstd there? Without it the functions that open give NULL. */
bool compressed_is_built_in(void);

/* --- reading --- */

typedef struct compressed_input compressed_input;

/* The next n bytes at most of the file as it is: their number, 0 at its end, negative: a failure. */
typedef long (*compressed_fetch)(void *context, uint8_t *bytes, size_t n);

/* What one read came to, besides a number of bytes. */
enum { COMPRESSED_END = 0, COMPRESSED_FAILED = -1, COMPRESSED_DAMAGED = -2, COMPRESSED_CUT = -3 };

/* NULL where there is no memory, or no libzstd. */
compressed_input *compressed_input_open(compressed_fetch fetch, void *context);

/* The next n bytes at most: their number, or one of the above. */
long compressed_input_read(compressed_input *in, uint8_t *bytes, size_t n);
void compressed_input_close(compressed_input *in);

/* --- writing --- */

typedef struct compressed_output compressed_output;

/* Into a file that stays the caller's. */
compressed_output *compressed_output_open(FILE *file);
bool compressed_output_write(compressed_output *out, const uint8_t *bytes, size_t n);

/* Writes what is left, and frees; NULL: nothing. A failure shows in ferror(file) too. */
bool compressed_output_close(compressed_output *out);

#endif
