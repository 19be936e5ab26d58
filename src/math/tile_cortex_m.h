// SPDX-License-Identifier: MIT
/*
 * plr_tile_subtract of tile.h, which includes this file, for the FPU of a Cortex-M, in its own
 * instructions. A tile of 4 x 6 fills s0 to s23; a row of W comes into s24 to s29 with one load,
 * and two elements of U at a time into s30 and s31. Compilers load one register at a time, which
 * makes 38 instructions of a step; here it is 30. The numbers are multiplied and added in the same
 * order as in C, so the bits are the same.
 */
#ifndef PLR_MATH_TILE_CORTEX_M_H
#define PLR_MATH_TILE_CORTEX_M_H

/* Step k: row r loses U(k, r) times row k of W. `shrink`: nothing, or makes to_next_U smaller. */
#define PLR_TILE_STEP(shrink)                                                                      \
    "vldmia %[W], {s24-s29}\n\t"                                                                   \
    "vldmia %[U]!, {s30-s31}\n\t"                                                                  \
    "vfms.f32 s0, s30, s24\n\t"                                                                    \
    "vfms.f32 s1, s30, s25\n\t"                                                                    \
    "vfms.f32 s2, s30, s26\n\t"                                                                    \
    "vfms.f32 s3, s30, s27\n\t"                                                                    \
    "vfms.f32 s4, s30, s28\n\t"                                                                    \
    "vfms.f32 s5, s30, s29\n\t"                                                                    \
    "vfms.f32 s6, s31, s24\n\t"                                                                    \
    "vfms.f32 s7, s31, s25\n\t"                                                                    \
    "vfms.f32 s8, s31, s26\n\t"                                                                    \
    "vfms.f32 s9, s31, s27\n\t"                                                                    \
    "vfms.f32 s10, s31, s28\n\t"                                                                   \
    "vfms.f32 s11, s31, s29\n\t"                                                                   \
    "vldmia %[U], {s30-s31}\n\t"                                                                   \
    "add %[U], %[to_next_U]\n\t" shrink "vfms.f32 s12, s30, s24\n\t"                               \
    "vfms.f32 s13, s30, s25\n\t"                                                                   \
    "vfms.f32 s14, s30, s26\n\t"                                                                   \
    "vfms.f32 s15, s30, s27\n\t"                                                                   \
    "vfms.f32 s16, s30, s28\n\t"                                                                   \
    "vfms.f32 s17, s30, s29\n\t"                                                                   \
    "add %[W], %[to_next_W]\n\t"                                                                   \
    "vfms.f32 s18, s31, s24\n\t"                                                                   \
    "vfms.f32 s19, s31, s25\n\t"                                                                   \
    "vfms.f32 s20, s31, s26\n\t"                                                                   \
    "vfms.f32 s21, s31, s27\n\t"                                                                   \
    "vfms.f32 s22, s31, s28\n\t"                                                                   \
    "vfms.f32 s23, s31, s29\n\t"

/* clang-format off */
/* Two steps a turn; an odd depth begins with the second of them. */
#define PLR_TILE_STEPS(shrink)                                                                     \
    __asm__ volatile(                                                                              \
        "vldmia %[row0], {s0-s5}\n\t"                                                              \
        "vldmia %[row1], {s6-s11}\n\t"                                                             \
        "vldmia %[row2], {s12-s17}\n\t"                                                            \
        "vldmia %[row3], {s18-s23}\n\t"                                                            \
        "tst %[depth], #1\n\t"                                                                     \
        "bne 2f\n"                                                                                 \
        "1:\n\t"                                                                                   \
        PLR_TILE_STEP(shrink)                                                                      \
        "2:\n\t"                                                                                   \
        PLR_TILE_STEP(shrink)                                                                      \
        "subs %[depth], #2\n\t"                                                                    \
        "bgt 1b\n\t"                                                                               \
        "vstmia %[row0]!, {s0-s5}\n\t"                                                             \
        "vstmia %[row1]!, {s6-s11}\n\t"                                                            \
        "vstmia %[row2]!, {s12-s17}\n\t"                                                           \
        "vstmia %[row3]!, {s18-s23}"                                                               \
        : [U] "+r"(at.U), [W] "+r"(at.W), [to_next_U] "+r"(to_next_U), [depth] "+r"(depth),        \
          [row0] "+r"(row[0]), [row1] "+r"(row[1]), [row2] "+r"(row[2]), [row3] "+r"(row[3])       \
        : [to_next_W] "r"(to_next_W)                                                               \
        : "s0", "s1", "s2", "s3", "s4", "s5", "s6", "s7", "s8", "s9", "s10", "s11", "s12", "s13",  \
          "s14", "s15", "s16", "s17", "s18", "s19", "s20", "s21", "s22", "s23", "s24", "s25",      \
          "s26", "s27", "s28", "s29", "s30", "s31", "cc", "memory")
/* clang-format on */

static inline void plr_tile_subtract(unsigned depth, plr_tile_factors at,
                                     plr_real *row[PLR_TILE_ROWS]) {
    /* in bytes; the first load of U has stepped over two elements */
    size_t to_next_U = (at.to_next_U - 2) * sizeof(plr_real);
    const size_t to_next_W = at.to_next_W * sizeof(plr_real);
    PLR_ASSERT(depth >= 1 && at.shrink <= 1);
    if (at.shrink)
        PLR_TILE_STEPS("sub %[to_next_U], #4\n\t");
    else
        PLR_TILE_STEPS("");
}

#endif
