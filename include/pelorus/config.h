// SPDX-License-Identifier: MIT
/*
 * Compile-time configuration: precision, capacities, fused multiply-add.
 *
 * Every value has a default here and can be set on the compiler's command line (CMake has options
 * of the same names). All translation units that share a filter must use the same values;
 * plr_filter_init and plr_session_init refuse a caller that was compiled with others. Preprocessor
 * conditions occur here and in assertions.h alone.
 */
#ifndef PELORUS_CONFIG_H
#define PELORUS_CONFIG_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Version, major << 16 | minor << 8 | patch; plr_version() has it as text. */
#define PLR_VERSION_NUMBER 0x000100

/* Increases with every change of the source that changes the bits of a result. It is part of the
 * build fingerprint, so a log shows whether it was made by the same arithmetic as this source's.
 * tests/golden fails if the bits change and this number does not. */
#define PLR_ARITHMETIC 25

/* Precision of the filter's arithmetic: 32 (float; default) or 64 (double). For the model `body`
 * float is as accurate (docs/NUMERICS.md) and takes half the RAM; choose 64 for `world`. */
#ifndef PLR_REAL
#define PLR_REAL 32
#endif

/* Most landmarks that a filter can hold: 1 to 1024, default 32. RAM grows with the square: 27 KB
 * for 16 landmarks, 53 KB for 32 (docs/SIZES.md has more). The setting `slots` can use fewer. */
#ifndef PLR_MAX_LANDMARKS
#define PLR_MAX_LANDMARKS 32
#endif

/* Most observations in one frame: 1 to 4096, default 128. A frame with more is refused, so choose
 * the most that the tracker can send. Each takes 8 bytes of RAM in the filter (where an address has 4), and
 * 120 in a session. */
#ifndef PLR_MAX_OBSERVATIONS
#define PLR_MAX_OBSERVATIONS 128
#endif

/* Observations processed at once in an update: 1 to 16, default 8. More need more memory and stack.
 * Results depend on it in their last bits, so it is part of the build fingerprint: leave it at 8
 * unless you build everything, robot and desk, yourself. */
#ifndef PLR_BLOCK_OBSERVATIONS
#define PLR_BLOCK_OBSERVATIONS 8
#endif

/* 0 (default) or 1. 1: fused multiply-add is computed in software instead of by the processor's
 * instruction; slower, the same bits. For processors without that instruction. */
#ifndef PLR_PORTABLE
#define PLR_PORTABLE 0
#endif

/* 1 (default) or 0. 0: without src/supervise, which is then not compiled: the estimator alone. Nothing is
 * doubted, every picture is used, and health is that of a filter whose input is all good. */
#ifndef PLR_SUPERVISE
#define PLR_SUPERVISE 1
#endif

/* Most numbers of the calibration that can be estimated (setting calibrate): 0 to 13, default
 * 5, for focal length, baseline and turn. Up to 5 take no more memory than to consider these does, which
 * every build can; up to 9, and up to 13, four numbers more for each row of the state. No bit of what is
 * computed without them depends on it. */
#ifndef PLR_MAX_CALIBRATION
#define PLR_MAX_CALIBRATION 5
#endif

/* 1 (default) or 0. 0: without src/known_map, which is then not compiled: known-map and localization are
 * refused. */
#ifndef PLR_KNOWN_MAP
#define PLR_KNOWN_MAP 1
#endif

/* 1 (default) or 0. 0: without src/vision, which is then not compiled: pictures are somebody else's. */
#ifndef PLR_VISION
#define PLR_VISION 1
#endif

/* Of vision.h alone: most pixels of a picture (default 76800, 320 x 240), most points that are followed, 1 to 1024
 * (default 50), and most levels of a pyramid, 1 to 6 (default 4). The pair's pictures are the caller's;
 * beside them a plr_vision takes 2/3 of a picture, and 121 bytes a level and some 200 for each point. */
#ifndef PLR_VISION_PIXELS
#define PLR_VISION_PIXELS 76800
#endif
#ifndef PLR_VISION_TRACKS
#define PLR_VISION_TRACKS 50
#endif
#ifndef PLR_VISION_LEVELS
#define PLR_VISION_LEVELS 4
#endif

/* Columns of the tile that the update's kernel keeps in registers: a divisor of 16 or 6, default 16
 * with AVX, 8 with WebAssembly's relaxed SIMD, else 4. It changes the speed, and no bit of a result. */
#ifndef PLR_TILE_COLUMNS
#if defined(__AVX__)
#define PLR_TILE_COLUMNS 16
#elif defined(__wasm_relaxed_simd__)
#define PLR_TILE_COLUMNS 8
#else
#define PLR_TILE_COLUMNS 4
#endif
#endif

/* The kernel's inner loop: in a Cortex-M's own instructions if the tile has 6 columns and the
 * compiler optimises, else in C. It changes no bit either. */
#if defined(__thumb2__) && defined(__ARM_FEATURE_FMA) && defined(__OPTIMIZE__) &&                  \
    PLR_REAL == 32 && PLR_TILE_COLUMNS == 6 && !PLR_PORTABLE
#define PLR_TILE_CORTEX_M 1
#define PLR_TILE_FILE     "math/tile_cortex_m.h"
#else
#define PLR_TILE_CORTEX_M 0
#define PLR_TILE_FILE     "math/tile_in_c.h"
#endif

/* A row of it: by the vectors of WebAssembly's relaxed SIMD, else in C. */
#if defined(__wasm_relaxed_simd__) && PLR_REAL == 32 && !PLR_PORTABLE
#define PLR_WASM_FMA 1
#define PLR_ROW_FILE "math/row_wasm.h"
#else
#define PLR_WASM_FMA 0
#define PLR_ROW_FILE "math/row_in_c.h"
#endif

/* Eyes' loops over pixels: in the integer vectors of a Cortex-M55 where the compiler may use them, else in C. They
 * change no bit. */
#if defined(__ARM_FEATURE_MVE) && !PLR_PORTABLE
#define PLR_PIXELS_MVE  1
#define PLR_PIXELS_FILE "vision/kernels_mve.h"
#else
#define PLR_PIXELS_MVE  0
#define PLR_PIXELS_FILE "vision/kernels_in_c.h"
#endif

#if defined(__FAST_MATH__)
#error "Pelorus needs IEEE arithmetic: build without -ffast-math."
#endif
#if !defined(__FLT_EVAL_METHOD__) || __FLT_EVAL_METHOD__ != 0
#error "Pelorus needs FLT_EVAL_METHOD 0 (on 32-bit x86: -msse2 -mfpmath=sse)."
#endif
#if PLR_TILE_COLUMNS < 1 || (16 % PLR_TILE_COLUMNS != 0 && 6 % PLR_TILE_COLUMNS != 0)
#error "PLR_TILE_COLUMNS must divide 16 or 6."
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

#if PLR_MAX_CALIBRATION < 0 || PLR_MAX_CALIBRATION > 13
#error "PLR_MAX_CALIBRATION must be 0 to 13."
#endif

#if PLR_VISION_PIXELS < 2304 || PLR_VISION_PIXELS > 16777216
#error "PLR_VISION_PIXELS must be 2304 to 16777216."
#endif
#if PLR_VISION_TRACKS < 1 || PLR_VISION_TRACKS > 1024
#error "PLR_VISION_TRACKS must be 1 to 1024."
#endif
#if PLR_VISION_LEVELS < 1 || PLR_VISION_LEVELS > 6
#error "PLR_VISION_LEVELS must be 1 to 6."
#endif

#if PLR_REAL == 32
typedef float plr_real;
/* a b + c with a single rounding, in float32. */
#if PLR_PORTABLE
#define PLR_FMA(a, b, c) plr_fmaf_portable((a), (b), (c))
#elif PLR_WASM_FMA
/* Whether this is fused is the machine's choice, once for all: who runs such a program asks it first
 * (docs/INSTALL.md), and takes a portable one where it is not. */
typedef float plr_four __attribute__((vector_size(16)));
static inline float plr_fmaf_wasm(float a, float b, float c) {
    const plr_four four_a = {a, a, a, a}, four_b = {b, b, b, b}, four_c = {c, c, c, c};
    return __builtin_wasm_relaxed_madd_f32x4(four_a, four_b, four_c)[0];
}
#define PLR_FMA(a, b, c) plr_fmaf_wasm((a), (b), (c))
#else
#define PLR_FMA(a, b, c) __builtin_fmaf((a), (b), (c))
#endif
#define PLR_SQRT(x)         __builtin_sqrtf(x)
#define PLR_SMALLEST_NORMAL 1.17549435e-38F
#define PLR_EPSILON         1.1920928955078125e-7F
#elif PLR_REAL == 64
typedef double plr_real;
/* In float64 product and sum are rounded apart: not every target has the fused instruction. */
#define PLR_FMA(a, b, c)    ((a) * (b) + (c))
#define PLR_SQRT(x)         __builtin_sqrt(x)
#define PLR_SMALLEST_NORMAL 2.2250738585072014e-308
#define PLR_EPSILON         2.220446049250313e-16
#else
#error "PLR_REAL must be 32 or 64."
#endif

/* a b + c in float32, rounded once, for processors without an instruction for it: the same bits for
 * every finite input and for infinities; a NaN results in a NaN. */
float plr_fmaf_exact(float a, float b, float c);

/* The same, fast. The product is exact in double. Rounding the sum to double and then to float32 is
 * wrong only if the double lies halfway between two float32 (docs/NUMERICS.md, 8): for a normal result
 * its last 29 bits then are 1 and zeros. Subnormal ones are left to the long way. */
static inline float plr_fmaf_portable(float a, float b, float c) {
    const double sum = (double)a * (double)b + (double)c;
    uint64_t bits;
    __builtin_memcpy(&bits, &sum, sizeof bits);
    const int is_normal = __builtin_fabs(sum) >= 1.1754943508222875e-38;
    if (sum != 0 && (!is_normal || (bits & 0x1FFFFFFFU) == 0x10000000U))
        return plr_fmaf_exact(a, b, c);
    return (float)sum;
}

/* A function that few frames need: it is compiled to be small, even where the others of its file are
 * compiled to be fast. */
#define PLR_SELDOM __attribute__((cold))

/* A constant in the filter's precision. */
#define PLR_R(x) ((plr_real)(x))

enum {
    PLR_POSE_DIM = 6, /* (rho, theta): of a pose, and of any rigid motion */
    PLR_POSE_SQUARE = PLR_POSE_DIM * PLR_POSE_DIM,
    PLR_POSE_TRIANGLE = PLR_POSE_DIM * (PLR_POSE_DIM + 1) / 2,
    PLR_VELOCITY_DIM = 3,
    PLR_BIAS_DIM = 6, /* linear, then angular: (b_v, b_w) of twists, (b_a, b_g) of an IMU */
    PLR_CORE_DIM = PLR_POSE_DIM + PLR_VELOCITY_DIM + PLR_BIAS_DIM, /* most rows before landmarks */
    PLR_REST_DIM = PLR_VELOCITY_DIM + PLR_BIAS_DIM,                /* of it, behind the pose */
    PLR_DRIVERS = 12, /* most rows of the state that a motion depends on */
    PLR_MOTION_BY = PLR_POSE_DIM * PLR_DRIVERS,
    PLR_LANDMARK_DIM = 3, /* w_i or dm_i */
    PLR_ROWS = 3,         /* rows of a measurement */
    PLR_WIDEST_BLOCK = 6, /* of the state */
    PLR_BLOCK_ROWS = PLR_ROWS * PLR_BLOCK_OBSERVATIONS,
    PLR_WORK_ROWS = PLR_BLOCK_ROWS > 24 ? PLR_BLOCK_ROWS : 24, /* a predict needs 4 x 6 */
    PLR_MAX_STATE = PLR_CORE_DIM + PLR_LANDMARK_DIM * PLR_MAX_LANDMARKS,
    /* The leading dimension is a multiple of the tile's width, which the library alone knows: it is
     * at most this, for every width that divides 16 or 6. */
    PLR_LD_OF_16 = (PLR_MAX_STATE + 15) / 16 * 16,
    PLR_LD_OF_6 = (PLR_MAX_STATE + 5) / 6 * 6,
    PLR_MAX_LD = PLR_LD_OF_16 > PLR_LD_OF_6 ? PLR_LD_OF_16 : PLR_LD_OF_6,
    PLR_KERNEL_MARGIN = 20, /* elements that a kernel may read beyond the end of a matrix */
    PLR_PACKED_SIZE = PLR_MAX_STATE * (PLR_MAX_STATE + 1) / 2,
    /* Steps of the process that lead back to where a camera with a late clock was. */
    PLR_CLOCK_STEPS = 8,
    /* Errors of the calibration that can be considered or estimated together: with the seven other
     * columns of a correction they make whole tiles of four, or one more than that. */
    PLR_CALIBRATIONS = PLR_MAX_CALIBRATION <= 5    ? 5
                       : PLR_MAX_CALIBRATION == 6  ? 6
                       : PLR_MAX_CALIBRATION <= 9  ? 9
                       : PLR_MAX_CALIBRATION == 10 ? 10
                                                   : 13
};

/* What the memory layout of a filter or session depends on in one translation unit, and its size in
 * bytes. Every init passes the caller's to the library, which refuses others than its own. */
typedef struct plr_sizes {
    uint32_t bytes, real, landmarks, observations, block, calibration;
} plr_sizes;

/* The sizes of the translation unit that calls this, for a struct of so many bytes. */
static inline plr_sizes plr_sizes_here(uint32_t bytes) {
    plr_sizes sizes;
    sizes.bytes = bytes;
    sizes.real = PLR_REAL;
    sizes.landmarks = PLR_MAX_LANDMARKS;
    sizes.observations = PLR_MAX_OBSERVATIONS;
    sizes.block = PLR_BLOCK_OBSERVATIONS;
    sizes.calibration = PLR_MAX_CALIBRATION;
    return sizes;
}

static inline int plr_sizes_agree(const plr_sizes *a, const plr_sizes *b) {
    return a->bytes == b->bytes && a->real == b->real && a->landmarks == b->landmarks &&
           a->observations == b->observations && a->block == b->block &&
           a->calibration == b->calibration;
}

#ifdef __cplusplus
}
#endif

#endif
