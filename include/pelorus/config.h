// SPDX-License-Identifier: MIT
/*
 * Compile-time configuration: precision, capacities, fused multiply-add.
 *
 * Every value has a default here and may be overridden on the compiler's command line (CMake does
 * that through options of the same names). Two translation units that share a filter must agree on
 * all of them: plr_filter_init and plr_session_init refuse a caller who does not. This is the only
 * file of the library in which preprocessor conditions stand.
 */
#ifndef PELORUS_CONFIG_H
#define PELORUS_CONFIG_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Version, major << 16 | minor << 8 | patch; plr_version() has it as text. */
#define PLR_VERSION_NUMBER 0x000100

/* Counts the changes after which a filter computes other bits; part of the build fingerprint, so that
 * a log tells whether its robot computed as this source does. tests/golden asks for it. */
#define PLR_ARITHMETIC 4

/* Bits of a real: 32 (float, the main road) or 64 (double). */
#ifndef PLR_REAL
#define PLR_REAL 32
#endif

/* Most landmarks that a filter can hold, 1 to 1024. RAM grows with its square: see docs/SIZES.md.
 * A config may use fewer (setting `slots`). */
#ifndef PLR_MAX_LANDMARKS
#define PLR_MAX_LANDMARKS 32
#endif

/* Most observations in one frame, 1 to 4096. Four bytes of RAM each; more are refused. */
#ifndef PLR_MAX_OBSERVATIONS
#define PLR_MAX_OBSERVATIONS 128
#endif

/* Observations processed at once in an update. The bits of a result depend on it, therefore it is
 * part of the build fingerprint; 8 in every image that the project makes. 1 to 16. */
#ifndef PLR_BLOCK_OBSERVATIONS
#define PLR_BLOCK_OBSERVATIONS 8
#endif

/* 1: an exact fused multiply-add of our own instead of the processor's: slower, the same bits. For
 * processors without the instruction. */
#ifndef PLR_PORTABLE
#define PLR_PORTABLE 0
#endif

/* Columns of the tile that the update's kernel keeps in registers. It changes the speed, no bit. */
#ifndef PLR_TILE_COLUMNS
#if defined(__AVX__)
#define PLR_TILE_COLUMNS 16
#else
#define PLR_TILE_COLUMNS 4
#endif
#endif

#if defined(__FAST_MATH__)
#error "Pelorus needs IEEE arithmetic: build without -ffast-math."
#endif
#if !defined(__FLT_EVAL_METHOD__) || __FLT_EVAL_METHOD__ != 0
#error "Pelorus needs FLT_EVAL_METHOD 0 (on 32-bit x86: -msse2 -mfpmath=sse)."
#endif
#if PLR_TILE_COLUMNS < 1 || PLR_TILE_COLUMNS > 16
#error "PLR_TILE_COLUMNS must be 1 to 16."
#endif
#if PLR_MAX_LANDMARKS < 1 || PLR_MAX_LANDMARKS > 1024
#error "PLR_MAX_LANDMARKS must be 1 to 1024."
#endif
#if PLR_MAX_OBSERVATIONS < 1 || PLR_MAX_OBSERVATIONS > 4096
#error "PLR_MAX_OBSERVATIONS must be 1 to 4096."
#endif
#if PLR_BLOCK_OBSERVATIONS < 1 || PLR_BLOCK_OBSERVATIONS > 16
#error "PLR_BLOCK_OBSERVATIONS must be 1 to 16."
#endif

#if PLR_REAL == 32
typedef float plr_real;
/* round(a b + c), with a single rounding in float32. */
#if PLR_PORTABLE
float plr_fmaf_exact(float a, float b, float c);
#define PLR_FMA(a, b, c) plr_fmaf_exact((a), (b), (c))
#else
#define PLR_FMA(a, b, c) __builtin_fmaf((a), (b), (c))
#endif
#define PLR_SQRT(x)         __builtin_sqrtf(x)
#define PLR_SMALLEST_NORMAL 1.17549435e-38F
#define PLR_EPSILON         1.1920928955078125e-7F
#elif PLR_REAL == 64
typedef double plr_real;
/* float64 rounds twice on every target: not all of them fuse it. */
#define PLR_FMA(a, b, c)    ((a) * (b) + (c))
#define PLR_SQRT(x)         __builtin_sqrt(x)
#define PLR_SMALLEST_NORMAL 2.2250738585072014e-308
#define PLR_EPSILON         2.220446049250313e-16
#else
#error "PLR_REAL must be 32 or 64."
#endif

/* A constant in the filter's precision. */
#define PLR_R(x) ((plr_real)(x))

enum {
    PLR_POSE_DIM = 6,     /* (rho, theta) */
    PLR_BIAS_DIM = 6,     /* (b_v, b_w) */
    PLR_LANDMARK_DIM = 3, /* w_i or dm_i */
    PLR_ROWS = 3,         /* rows of an observation: uL, uR, v */
    PLR_BLOCK_ROWS = PLR_ROWS * PLR_BLOCK_OBSERVATIONS,
    PLR_WORK_ROWS = PLR_BLOCK_ROWS > 24 ? PLR_BLOCK_ROWS : 24, /* a predict needs 4 x 6 */
    PLR_MAX_STATE = PLR_POSE_DIM + PLR_BIAS_DIM + PLR_LANDMARK_DIM * PLR_MAX_LANDMARKS,
    PLR_MAX_LD = (PLR_MAX_STATE + 15) / 16 * 16, /* whole tiles, whatever their width */
    PLR_KERNEL_MARGIN = 20, /* elements that a kernel may read beyond its end */
    PLR_PACKED_SIZE = PLR_MAX_STATE * (PLR_MAX_STATE + 1) / 2
};

/* What the layout of a filter or a session hangs on, as one translation unit was compiled, and how
 * large it is there. Every init hands over the caller's; the library refuses what is not its own. */
typedef struct plr_sizes {
    uint32_t bytes, real, landmarks, observations, block;
} plr_sizes;

/* Those of the translation unit that calls it. */
static inline plr_sizes plr_sizes_here(uint32_t bytes) {
    plr_sizes sizes;
    sizes.bytes = bytes;
    sizes.real = PLR_REAL;
    sizes.landmarks = PLR_MAX_LANDMARKS;
    sizes.observations = PLR_MAX_OBSERVATIONS;
    sizes.block = PLR_BLOCK_OBSERVATIONS;
    return sizes;
}

static inline int plr_sizes_agree(const plr_sizes *a, const plr_sizes *b) {
    return a->bytes == b->bytes && a->real == b->real && a->landmarks == b->landmarks &&
           a->observations == b->observations && a->block == b->block;
}

#ifdef __cplusplus
}
#endif

#endif
