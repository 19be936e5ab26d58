// SPDX-License-Identifier: MIT
#include <stdlib.h>
#include <string.h>
#include <zstd.h>

#include "posix/compressed.h"

/* Pixels are nearly random in their last digits: a low level leaves a sixth more. */
enum { LEVEL = 19, PIECE = 1 << 16 };

struct compressed_input {
    ZSTD_DStream *stream;
    compressed_fetch fetch;
    void *context;
    ZSTD_inBuffer packed;
    bool inside; /* a zstd frame has begun and not ended */
    uint8_t piece[PIECE];
};

struct compressed_output {
    ZSTD_CStream *stream;
    FILE *file;
    uint8_t piece[PIECE];
};

bool compressed_is_built_in(void) {
    return true;
}

compressed_input *compressed_input_open(compressed_fetch fetch, void *context) {
    compressed_input *in = calloc(1, sizeof *in);
    if (in == NULL)
        return NULL;
    in->stream = ZSTD_createDStream();
    in->fetch = fetch;
    in->context = context;
    in->packed.src = in->piece;
    if (in->stream != NULL && !ZSTD_isError(ZSTD_initDStream(in->stream)))
        return in;
    compressed_input_close(in);
    return NULL;
}

long compressed_input_read(compressed_input *in, uint8_t *bytes, size_t n) {
    ZSTD_outBuffer out = {bytes, n, 0};
    while (out.pos == 0) {
        if (in->packed.pos == in->packed.size) {
            const long count = in->fetch(in->context, in->piece, sizeof in->piece);
            if (count < 0)
                return COMPRESSED_FAILED;
            if (count == 0)
                return in->inside ? COMPRESSED_CUT : COMPRESSED_END;
            in->packed.pos = 0;
            in->packed.size = (size_t)count;
        }
        const size_t left = ZSTD_decompressStream(in->stream, &out, &in->packed);
        if (ZSTD_isError(left))
            return COMPRESSED_DAMAGED;
        in->inside = left != 0;
    }
    return (long)out.pos;
}

void compressed_input_close(compressed_input *in) {
    if (in != NULL)
        ZSTD_freeDStream(in->stream);
    free(in);
}

compressed_output *compressed_output_open(FILE *file) {
    compressed_output *out = calloc(1, sizeof *out);
    if (out == NULL)
        return NULL;
    out->file = file;
    out->stream = ZSTD_createCStream();
    if (out->stream != NULL &&
        !ZSTD_isError(ZSTD_CCtx_setParameter(out->stream, ZSTD_c_compressionLevel, LEVEL)) &&
        !ZSTD_isError(ZSTD_CCtx_setParameter(out->stream, ZSTD_c_checksumFlag, 1)))
        return out;
    ZSTD_freeCStream(out->stream);
    free(out);
    return NULL;
}

/* Hands bytes over and writes what comes out, until nothing is left of them (or, at the end, in the
 * stream). */
static bool press(compressed_output *out, const uint8_t *bytes, size_t n, ZSTD_EndDirective how) {
    ZSTD_inBuffer in = {bytes, n, 0};
    size_t left;
    do {
        ZSTD_outBuffer packed = {out->piece, sizeof out->piece, 0};
        left = ZSTD_compressStream2(out->stream, &packed, &in, how);
        if (ZSTD_isError(left) || fwrite(out->piece, 1, packed.pos, out->file) != packed.pos)
            return false;
    } while (in.pos < in.size || (how == ZSTD_e_end && left > 0));
    return true;
}

bool compressed_output_write(compressed_output *out, const uint8_t *bytes, size_t n) {
    return press(out, bytes, n, ZSTD_e_continue);
}

bool compressed_output_close(compressed_output *out) {
    if (out == NULL)
        return true;
    const bool good = press(out, NULL, 0, ZSTD_e_end);
    ZSTD_freeCStream(out->stream);
    free(out);
    return good;
}
