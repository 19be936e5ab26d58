// SPDX-License-Identifier: MIT
#include "process/imu_noise.h"

#include <stdbool.h>
#include <string.h>

#include "math/tile.h"

enum { THETA = PLR_CORE_THETA, VEL = PLR_CORE_VEL, ACCEL = PLR_CORE_ACCEL, GYRO = PLR_CORE_GYRO };
enum { DIM = PLR_CORE_DIM, MOVED = PLR_CORE_MOVED };
enum { POSE = PLR_POSE_DIM, REST = PLR_REST_DIM, THREE = 3, BIASES = PLR_BIAS_DIM };
enum { V = 0, B_A = 3, B_G = 6 }; /* columns of Q_nc and Q_cc */

/* Blocks of the new Q, 3 x 3, with one leading dimension. Of two, the one whose rows of F are zero in more columns
 * stands on the right. */
typedef struct plr_noise_blocks {
    const plr_real *rho_rho, *rho_theta, *rho_v, *theta_theta, *v_theta, *v_v;
} plr_noise_blocks;

/* Of those on the diagonal the lower triangle is read. */
static inline void put_blocks(plr_motion *motion, unsigned ld, plr_noise_blocks from) {
    plr_real *nn = motion->Q, *nc = motion->core.Q_nc, *cc = motion->core.Q_cc;
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j < 3; j++) {
            nn[POSE * i + THETA + j] = nn[POSE * (THETA + j) + i] = from.rho_theta[ld * i + j];
            nc[REST * i + j] = from.rho_v[ld * i + j];
            nc[REST * (THETA + j) + i] = from.v_theta[ld * i + j];
        }
    for (unsigned i = 0; i < 3; i++)
        for (unsigned j = 0; j <= i; j++) {
            const unsigned theta = POSE * (THETA + i) + THETA + j;
            const unsigned mirrored = POSE * (THETA + j) + THETA + i;
            nn[POSE * i + j] = nn[POSE * j + i] = from.rho_rho[ld * i + j];
            nn[theta] = nn[mirrored] = from.theta_theta[ld * i + j];
            cc[REST * i + j] = cc[REST * j + i] = from.v_v[ld * i + j];
        }
}

/* Three rows of X in n columns of the biases: they are those of the new Q, Q_to. Then X has the readings' noise, too. */
static inline void use_columns(unsigned n, const plr_real *restrict F,
                               const plr_real *restrict reading, unsigned ldx, plr_real *restrict X,
                               plr_real *restrict Q_to) {
    for (unsigned i = 0; i < 3; i++)
        for (unsigned c = 0; c < n; c++) {
            const plr_real x = X[ldx * i + c];
            Q_to[REST * i + c] = x;
            X[ldx * i + c] = PLR_FMA(F[DIM * i + c], reading[c], x);
        }
}

/* The columns of the biases of X = F Q, leading dimension ldx. */
static inline void use_bias_columns(plr_motion *motion, const plr_real F[MOVED * DIM],
                                    const plr_real reading[2], unsigned ldx, plr_real *X) {
    const plr_real noise[BIASES] = {reading[0], reading[0], reading[0],
                                    reading[1], reading[1], reading[1]};
    plr_real *nc = motion->core.Q_nc, *cc = motion->core.Q_cc;
    use_columns(BIASES, F + ACCEL, noise, ldx, X + ACCEL, nc + B_A);
    use_columns(THREE, F + DIM * THETA + GYRO, noise + 3, ldx, X + ldx * THETA + GYRO,
                nc + REST * THETA + B_G);
    use_columns(BIASES, F + DIM * VEL + ACCEL, noise, ldx, X + ldx * VEL + ACCEL, cc + B_A);
    for (unsigned c = B_A; c < REST; c++)
        for (unsigned i = 0; i < 3; i++)
            cc[REST * c + i] = cc[REST * i + c];
}

/* ---------------------------------------------------------------- by blocks: what is not zero */

/* Q by its parts, each row by row: of n = (rho, theta) with itself, with the rest (v, b_a, b_g), the
 * rest with n, and with itself. */
typedef struct plr_noise_parts {
    const plr_real *nn, *nc, *cc; /* leading dimensions POSE, REST, REST */
    plr_real cn[REST * POSE];
} plr_noise_parts;

/* sum (3 x n) += F Q for the rows from .. to - 1 of Q, of which the first is q. n is a constant where this is
 * inlined, and the sum stays in registers. */
static inline void add_product(unsigned n, const plr_real *F, unsigned from, unsigned to,
                               const plr_real *q, unsigned ldq, plr_real *sum) {
    for (unsigned l = from; l < to; l++, q += ldq)
        for (unsigned i = 0; i < 3; i++)
            for (unsigned c = 0; c < n; c++)
                sum[n * i + c] = PLR_FMA(F[DIM * i + l], q[c], sum[n * i + c]);
}

static inline void put(unsigned n, const plr_real *sum, plr_real *X) {
    for (unsigned i = 0; i < 3; i++)
        for (unsigned c = 0; c < n; c++)
            X[DIM * i + c] = sum[n * i + c];
}

/* Three rows of X = F Q in the biases' columns, n of them from `bias` on, after the sum over all other rows of Q:
 * of the biases' own rows one is not zero. */
static inline void put_bias(unsigned n, const plr_real *F, unsigned bias, const plr_real *cc,
                            plr_real *sum, plr_real *X) {
    for (unsigned c = 0; c < n; c++) {
        const plr_real q = cc[(REST + 1) * (bias - VEL + c)];
        for (unsigned i = 0; i < 3; i++)
            X[DIM * i + bias + c] = PLR_FMA(F[DIM * i + bias + c], q, sum[n * i + c]);
    }
}

static void carry_rho(const plr_real *restrict F, const plr_noise_parts *Q, plr_real *restrict X) {
    plr_real n[THREE * POSE] = {0}, v[THREE * THREE] = {0}, b[THREE * BIASES] = {0};
    add_product(POSE, F, 0, VEL, Q->nn, POSE, n);
    add_product(POSE, F, VEL, DIM, Q->cn, POSE, n);
    put(POSE, n, X);
    add_product(THREE, F, 0, VEL, Q->nc + V, REST, v);
    add_product(THREE, F, VEL, DIM, Q->cc + V, REST, v);
    put(THREE, v, X + VEL);
    add_product(BIASES, F, 0, VEL, Q->nc + B_A, REST, b);
    add_product(BIASES, F, VEL, ACCEL, Q->cc + B_A, REST, b);
    put_bias(BIASES, F, ACCEL, Q->cc, b, X);
}

/* The columns theta and b_g alone: no others are needed. */
static void carry_theta(const plr_real *restrict F, const plr_noise_parts *Q,
                        plr_real *restrict X) {
    plr_real theta[THREE * THREE] = {0}, gyro[THREE * THREE] = {0};
    add_product(THREE, F, THETA, VEL, Q->nn + POSE * THETA + THETA, POSE, theta);
    add_product(THREE, F, GYRO, DIM, Q->cn + POSE * B_G + THETA, POSE, theta);
    put(THREE, theta, X + THETA);
    add_product(THREE, F, THETA, VEL, Q->nc + REST * THETA + B_G, REST, gyro);
    put_bias(THREE, F, GYRO, Q->cc, gyro, X);
}

/* All columns but those of rho. */
static void carry_v(const plr_real *restrict F, const plr_noise_parts *Q, plr_real *restrict X) {
    plr_real theta[THREE * THREE] = {0}, v[THREE * THREE] = {0}, b[THREE * BIASES] = {0};
    add_product(THREE, F, THETA, VEL, Q->nn + POSE * THETA + THETA, POSE, theta);
    add_product(THREE, F, VEL, ACCEL, Q->cn + THETA, POSE, theta);
    add_product(THREE, F, GYRO, DIM, Q->cn + POSE * B_G + THETA, POSE, theta);
    put(THREE, theta, X + THETA);
    add_product(THREE, F, THETA, VEL, Q->nc + REST * THETA + V, REST, v);
    add_product(THREE, F, VEL, DIM, Q->cc + V, REST, v);
    put(THREE, v, X + VEL);
    add_product(BIASES, F, THETA, VEL, Q->nc + REST * THETA + B_A, REST, b);
    add_product(BIASES, F, VEL, ACCEL, Q->cc + B_A, REST, b);
    put_bias(BIASES, F, ACCEL, Q->cc, b, X);
}

/* block (3 x 3) += X F^T over the columns from .. to - 1; `lower`: its lower triangle alone. */
static inline void add_block(bool lower, const plr_real *X, const plr_real *F, unsigned from,
                             unsigned to, plr_real block[9]) {
    for (unsigned l = from; l < to; l++)
        for (unsigned i = 0; i < 3; i++)
            for (unsigned j = 0; j < (lower ? i + 1 : 3); j++)
                block[3 * i + j] = PLR_FMA(X[DIM * i + l], F[DIM * j + l], block[3 * i + j]);
}

/* Q = X F^T for the rows and columns of rho, theta and v. */
static void use_blocks(plr_motion *motion, const plr_real X[MOVED * DIM],
                       const plr_real F[MOVED * DIM]) {
    const plr_real *X_theta = X + DIM * THETA, *F_theta = F + DIM * THETA;
    const plr_real *X_v = X + DIM * VEL, *F_v = F + DIM * VEL;
    plr_real rho_rho[9] = {0}, rho_theta[9] = {0}, rho_v[9] = {0};
    plr_real theta_theta[9] = {0}, v_theta[9] = {0}, v_v[9] = {0};
    add_block(true, X, F, 0, DIM, rho_rho);
    add_block(false, X, F_theta, THETA, VEL, rho_theta);
    add_block(false, X, F_theta, GYRO, DIM, rho_theta);
    add_block(false, X, F_v, THETA, DIM, rho_v);
    add_block(true, X_theta, F_theta, THETA, VEL, theta_theta);
    add_block(true, X_theta, F_theta, GYRO, DIM, theta_theta);
    add_block(false, X_v, F_theta, THETA, VEL, v_theta);
    add_block(false, X_v, F_theta, GYRO, DIM, v_theta);
    add_block(true, X_v, F_v, THETA, DIM, v_v);
    put_blocks(motion, 3, (plr_noise_blocks){rho_rho, rho_theta, rho_v, theta_theta, v_theta, v_v});
}

void plr_imu_carry_by_blocks(plr_motion *motion, const plr_real F[MOVED * DIM],
                             const plr_real reading[2]) {
    plr_noise_parts Q = {.nn = motion->Q, .nc = motion->core.Q_nc, .cc = motion->core.Q_cc};
    plr_real X[MOVED * DIM];
    for (unsigned i = 0; i < REST; i++)
        for (unsigned j = 0; j < POSE; j++)
            Q.cn[POSE * i + j] = Q.nc[REST * j + i];
    carry_rho(F, &Q, X);
    carry_theta(F + DIM * THETA, &Q, X + DIM * THETA);
    carry_v(F + DIM * VEL, &Q, X + DIM * VEL);
    use_bias_columns(motion, F, reading, DIM, X);
    use_blocks(motion, X, F);
}

/* ---------------------------------------------------------------- in rows: whole vectors */

enum { WIDE = 16 };

static void get_noise(const plr_motion *motion, plr_real Q[DIM * WIDE]) {
    const plr_core_motion *m = &motion->core;
    for (unsigned i = 0; i < DIM; i++)
        Q[WIDE * i + DIM] = 0;
    for (unsigned i = 0; i < POSE; i++) {
        memcpy(Q + WIDE * i, motion->Q + POSE * i, POSE * sizeof *Q);
        memcpy(Q + WIDE * i + VEL, m->Q_nc + REST * i, REST * sizeof *Q);
    }
    for (unsigned i = 0; i < REST; i++) {
        memcpy(Q + WIDE * (VEL + i) + VEL, m->Q_cc + REST * i, REST * sizeof *Q);
        for (unsigned j = 0; j < POSE; j++)
            Q[WIDE * (VEL + i) + j] = m->Q_nc[REST * j + i];
    }
}

/* Three rows of C (9 x 16) = A B, where B is 15 x 16, from row `row` on: the columns of A from .. to - 1 and from
 * `more` on. Two loops: by one that leaps gcc 12 keeps the sums in memory, and a reading takes a tenth longer. */
static inline void multiply_rows(size_t row, size_t from, size_t to, size_t more,
                                 const plr_real *restrict A, size_t lda, const plr_real *restrict B,
                                 plr_real *restrict C) {
    A += lda * row;
    C += WIDE * row;
    for (size_t j = 0; j < WIDE; j += PLR_TILE_COLUMNS) {
        plr_tile_row c0 = {0}, c1 = {0}, c2 = {0};
        for (size_t l = from; l < to; l++) {
            plr_tile_accumulate(c0, A[l], B + WIDE * l + j);
            plr_tile_accumulate(c1, A[lda + l], B + WIDE * l + j);
            plr_tile_accumulate(c2, A[2 * lda + l], B + WIDE * l + j);
        }
        for (size_t l = more; l < DIM; l++) {
            plr_tile_accumulate(c0, A[l], B + WIDE * l + j);
            plr_tile_accumulate(c1, A[lda + l], B + WIDE * l + j);
            plr_tile_accumulate(c2, A[2 * lda + l], B + WIDE * l + j);
        }
        memcpy(C + j, c0, sizeof c0);
        memcpy(C + WIDE + j, c1, sizeof c1);
        memcpy(C + 2 * WIDE + j, c2, sizeof c2);
    }
}

/* C = A B, where A has the columns of F, or F^T the rows of B. */
static void multiply(const plr_real *A, size_t lda, const plr_real B[DIM * WIDE],
                     plr_real C[MOVED * WIDE]) {
    multiply_rows(0, 0, DIM, DIM, A, lda, B, C);
    multiply_rows(THETA, THETA, VEL, GYRO, A, lda, B, C);
    multiply_rows(VEL, THETA, DIM, DIM, A, lda, B, C);
}

static void transpose(const plr_real F[MOVED * DIM], plr_real Ft[DIM * WIDE]) {
    memset(Ft, 0, DIM * WIDE * sizeof *Ft);
    for (unsigned l = 0; l < DIM; l++)
        for (unsigned j = 0; j < 3; j++) {
            Ft[WIDE * l + j] = F[DIM * j + l];
            if ((l >= THETA && l < VEL) || l >= GYRO)
                Ft[WIDE * l + THETA + j] = F[DIM * (THETA + j) + l];
            if (l >= THETA)
                Ft[WIDE * l + VEL + j] = F[DIM * (VEL + j) + l];
        }
}

void plr_imu_carry_in_rows(plr_motion *motion, const plr_real F[MOVED * DIM],
                           const plr_real reading[2]) {
    plr_real Q[DIM * WIDE], X[MOVED * WIDE], Ft[DIM * WIDE], C[MOVED * WIDE];
    get_noise(motion, Q);
    multiply(F, DIM, Q, X);
    use_bias_columns(motion, F, reading, WIDE, X);
    transpose(F, Ft);
    multiply(X, WIDE, Ft, C);
    const plr_real *theta = C + WIDE * THETA, *v = C + WIDE * VEL;
    put_blocks(motion, WIDE,
               (plr_noise_blocks){C, C + THETA, C + VEL, theta + THETA, v + THETA, v + VEL});
}
